"""The guides hang together: links lead somewhere, the README is short, messages are real ones."""

import ast
import re
from pathlib import Path

import pytest
from guide_pages.pages import PAGES, README, ROOT, SECTIONS

from offboard.commands.guide import GUIDES

LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.M | re.S)
MOST_LINES = 200
LARGEST_PICTURE = 200_000
QUOTED = re.compile(r"`([^`]+)`")


def anchors(page: str) -> set[str]:
    """Return by which names the headings of a page can be linked, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", PAGES[page]), re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES)
def test_each_link_leads_to_a_file_and_a_heading(page):
    for target in LINK.findall(FENCE.sub("", PAGES[page])):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        file = ((ROOT / page).parent / path).resolve() if path else ROOT / page
        assert file.exists(), f"{page}: {target}"
        if anchor:
            there = str(file.relative_to(ROOT))
            assert anchor in anchors(there), f"{page}: {target}: {there} has {anchors(there)}"


def test_the_readme_is_short_and_shows_the_page():
    assert len(README.splitlines()) <= MOST_LINES
    (picture,) = re.findall(r"!\[[^\]]+\]\((.*?)\)", README)
    data = (ROOT / picture).read_bytes()
    assert data.startswith(b"\x89PNG")
    assert len(data) < LARGEST_PICTURE


def test_the_table_of_contents_of_the_readme_is_that_of_the_guides():
    table = re.findall(r"^\| \[.*?\]\((.*?)\) \|.*\| `klab guide (.*?)` \|$", README, re.M)
    expected = [(guide.path, topic) for topic, guide in GUIDES.items() if topic != "start"]
    assert sorted(table) == sorted(expected)


@pytest.mark.parametrize("page", [g.path for g in GUIDES.values() if g.path != "README.md"])
def test_a_long_page_begins_with_its_contents(page):
    titles = [s.title for s in SECTIONS if s.page == page and s.title]
    if len(PAGES[page].splitlines()) < MOST_LINES:
        return
    contents = PAGES[page].partition("\n## ")[0]
    linked = {link.removeprefix("#") for link in LINK.findall(contents) if link.startswith("#")}
    slugs = {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-"): t for t in titles}
    assert {t for slug, t in slugs.items() if slug not in linked} == set()


def spoken() -> str:
    """Return every text in the sources that a program can print, in one line."""
    texts = []
    for package in ("koopman_lab", "onboard", "offboard"):
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.JoinedStr):
                    parts = [v.value if isinstance(v, ast.Constant) else "…" for v in node.values]
                    texts.append("".join(map(str, parts)))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    texts.append(node.value)
    texts += [file.read_text() for file in sorted((ROOT / "scripts").glob("*.sh"))]
    return re.sub(r"\s+", " ", "\n".join(texts))


def test_the_messages_that_troubleshooting_explains_are_those_of_the_programs():
    said, page = spoken(), PAGES["offboard/TROUBLESHOOTING.md"]
    quoted = [
        re.sub(r"\s+", " ", words)
        for bold in re.findall(r"\*\*(`.*?`)\*\*", page, re.S)
        for words in QUOTED.findall(bold)
    ]
    assert len(quoted) > 30
    assert [words for words in quoted if words not in said] == []


def test_a_heading_is_linked_as_github_names_it():
    assert "look-into-the-data-exchange-them" in anchors("koopman_lab/README.md")


def test_no_page_is_left_out():
    """Whoever adds a guide to a room puts it into the table, or it is shown and tried by nobody."""
    rooms = ("koopman_lab", "onboard", "offboard", "lcmtypes")
    there = {str(f.relative_to(ROOT)) for room in rooms for f in (ROOT / room).rglob("*.md")}
    assert there <= set(PAGES)
    assert Path(ROOT / "scripts/results/README.md").exists()
