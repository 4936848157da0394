"""./scripts/docs makes a site in which every link leads somewhere."""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest
import typer
from guide_pages.pages import PAGES, ROOT

from offboard.cli.main import app
from offboard.terminal.needs import commands


class Page(HTMLParser):
    """Keeps the links of a page, what can be linked in it, and its text."""

    def __init__(self, text):
        super().__init__()
        self.links, self.ids, self.text = set(), set(), ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        del tag
        named = dict(attrs)
        self.links |= {named[key] for key in ("href", "src") if named.get(key)}
        self.ids |= {named[key] for key in ("id", "name") if named.get(key)}

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build it; return the folder and its pages by their paths in it."""
    folder = tmp_path_factory.mktemp("docs") / "site"
    done = subprocess.run(
        [sys.executable, "scripts/documentation/build.py", "--out", folder],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    files = folder.rglob("*.html")
    return folder, {f.relative_to(folder): Page(f.read_text()) for f in files}


def dead_links(folder, pages):
    """Return the links of pages that lead to no file, or to no place in it."""
    dead = []
    for path, page in pages.items():
        for link in page.links:
            target, _, anchor = unquote(link).partition("#")
            if "://" in target or target.startswith(("data:", "mailto:")):
                continue
            file = (
                (folder / path.parent / target.partition("?")[0]).resolve()
                if target
                else folder / path
            )
            there = pages.get(file.relative_to(folder.resolve()) if target else path)
            if not file.exists() or (anchor and there and anchor not in there.ids):
                dead.append(f"{path}: {link}")
    return dead


def test_every_link_leads_somewhere(site):
    folder, pages = site
    assert len(pages) > 100
    assert dead_links(folder, pages) == []


def test_a_dead_link_would_be_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<a id="x" href="b.html"></a><a href="#y"></a><a href="#x"></a>'
    )
    pages = {Path("a.html"): Page((tmp_path / "a.html").read_text())}
    assert sorted(dead_links(tmp_path, pages)) == ["a.html: #y", "a.html: b.html"]


def test_it_begins_with_the_readme_and_holds_every_guide(site):
    _, pages = site
    assert "README.html" in pages[Path("index.html")].links
    for page in PAGES:
        assert Path(page).with_suffix(".html") in pages


def test_the_reference_holds_every_command_setting_and_module(site):
    _, pages = site
    shown = pages[Path("reference/commands.html")].text
    for words, command in commands(typer.main.get_command(app)):
        assert command.hidden or f"klab {words}" in shown
    assert "largest_drift_ppm" in pages[Path("reference/configuration.html")].text
    assert "BilinearModel" in pages[Path("api/koopman_lab.koopman.bilinear_model.html")].text


def test_it_can_be_searched(site):
    folder, _ = site
    index = (folder / "searchindex.js").read_text()
    assert "TROUBLESHOOTING" in index
    assert (folder / "search.html").exists()
