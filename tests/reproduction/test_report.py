"""The report holds every claim and every figure, and its HTML needs no other file."""

import base64
import re

import numpy as np
import pytest
from matplotlib.image import imread, imsave

from offboard.reproduction.paper.claim import judge
from offboard.reproduction.paper.claims import CLAIMS
from offboard.reproduction.paper.page import Table, Text, as_html, as_markdown
from offboard.reproduction.paper.pictures import GRIDS, PICTURES, STUDIES
from offboard.reproduction.paper.report import Facts, write_report
from offboard.reproduction.paper.settings import SETTINGS
from offboard.reproduction.paper.step_record import StepRecord
from offboard.reproduction.paper.step_results import StepResults


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a reproduction of which only figures and tables are there, tiny ones."""
    place = tmp_path_factory.mktemp("reproduction")
    for picture in PICTURES:
        file = place / picture.step / f"{picture.stem}.png"
        file.parent.mkdir(exist_ok=True)
        imsave(file, np.full((6, 9, 3), 0.5))
    for study in STUDIES:
        (place / study).mkdir(exist_ok=True)
        (place / study / "table.csv").write_text("case,runs,p50_mm\nme-reprojected,40,0.123456\n")
    for grid in GRIDS:
        (place / grid).mkdir()
        lines = ("cost,x2_last_mm", "me,0.25", "ce,0.5", "ce,1.5", "ce,40.25", "ds,5.5")
        (place / grid / f"{grid}.csv").write_text("\n".join(lines))
    names = dict.fromkeys([*(picture.step for picture in PICTURES), *STUDIES, *GRIDS])
    made = {name: StepRecord(f"klab make {name}", 61.0, "0.1.0, abc") for name in names}
    found = StepResults(place)
    claims = [judge(claim, found) for claim in CLAIMS]
    settings = [judge(setting, found) for setting in SETTINGS]
    write_report(place, Facts(True, "40 random starts.", 7, made), claims, settings)
    return place


def shown(text):
    """Undo what Markdown and HTML need for special characters."""
    text = re.sub(r"\\([|*_])", r"\1", text)
    for entity, character in (("&lt;", "<"), ("&gt;", ">"), ("&#x27;", "'"), ("&amp;", "&")):
        text = text.replace(entity, character)
    return text


@pytest.mark.parametrize("ending", ["md", "html"])
def test_every_claim_with_its_rule_every_caption_and_command_is_in_the_report(folder, ending):
    text = shown((folder / f"report.{ending}").read_text())
    found = StepResults(folder)
    for claim in CLAIMS:
        assert claim.sentence in text
        assert claim.paper in text
        assert claim.remark in text
        for rule in judge(claim, found).rules:
            assert rule in text
    missing = [claim for claim in CLAIMS if not claim.name.endswith("-weights")]
    assert text.count("not measured (quick run)") == len(missing)
    cells = ("ce", "3", "0.5", "1.5", "40.25", "33 %", "67 %", "67 %")
    row = "".join(f"<td>{cell}</td>" for cell in cells)
    if ending == "md":
        row = f"| {' | '.join(cells)} |"
    assert text.count(row) == len(GRIDS)
    for setting in SETTINGS:
        assert setting.sentence in text
    for picture in PICTURES:
        assert picture.caption in text
        assert f"klab make {picture.step}" in text
    assert "QUICK RUN. 40 random starts. Seed 7; version 0.1.0, abc; the steps took" in text
    assert "0.1235" in text


def test_images_are_files_beside_the_markdown_and_inside_the_html(folder):
    links = re.findall(r"!\[[^]]*\]\(([^)]*)\)", (folder / "report.md").read_text())
    assert len(links) == len(PICTURES)
    assert all((folder / link).is_file() for link in links)
    page = (folder / "report.html").read_text()
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) == len(PICTURES)
    for source, link in zip(sources, links, strict=True):
        kind, data = source.split(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data) == (folder / link).read_bytes()
    assert not re.search(r"href|url\(|@import|<script|<link|https?://", page)


def test_the_page_of_results_gets_a_table_of_all_claims_and_a_few_small_figures(folder):
    section = (folder / "results-page" / "section.md").read_text()
    assert all(claim.sentence in shown(section) for claim in CLAIMS)
    assert "A quick run." in section
    wanted = {f"{picture.step}.png" for picture in PICTURES if picture.shown}
    assert {file.name for file in (folder / "results-page").glob("*.png")} == wanted
    assert all(f"({name})" in section for name in wanted)
    assert imread(folder / "results-page" / "dynamic-parking.png").shape[:2] == (3, 4)


def test_text_with_special_characters_is_shown_as_it_is(tmp_path):
    page = [Text("|x2| < 3 & a_b"), Table(("a",), [["|x2|\n<b>"]])]
    assert as_markdown(page) == (
        "\\|x2\\| &lt; 3 & a\\_b\n\n| a |\n| --- |\n| \\|x2\\|<br>&lt;b> |\n"
    )
    assert "<p>|x2| &lt; 3 &amp; a_b</p>" in as_html(page, tmp_path)
    assert "<td>|x2|<br>&lt;b&gt;</td>" in as_html(page, tmp_path)
