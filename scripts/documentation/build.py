"""Build the site of the documentation with Sphinx; ./scripts/docs calls this.

Pages keep the paths that they have in the repository, so that their links and pictures need no
translation; what is generated from the code is written beside them.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

from reference import command_pages, configuration_page
from sphinx.cmd.build import build_main
from sphinx.ext import apidoc

from offboard.commands.guide import GUIDES

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
DEFAULT = ROOT / "build" / "docs" / "site"
LINK = re.compile(r"\]\((?!\w+://|#)([^)#\s]+)")
"""To a file of the repository, a picture perhaps."""
REFERENCE = ("reference/commands", "reference/configuration", "api/modules")
FRONT = (
    '<meta http-equiv="refresh" content="0; url=README.html"><a href="README.html">koopman-lab</a>'
)


def pages() -> list[Path]:
    """Return the pages of the repository that the site shows, those of the guides first."""
    guides = [ROOT / guide.path for guide in GUIDES.values()]
    others = sorted((ROOT / ".github").glob("*.md"))
    # What has no title is a form that somebody fills in.
    titled = [page for page in others if page.read_text().startswith("# ")]
    return list(dict.fromkeys([*guides, *titled]))


def contents() -> str:
    """Return the tree of contents that stands beside every page; in the README nobody sees it."""
    names = [str(page.relative_to(ROOT).with_suffix("")) for page in pages()]
    listed = "\n".join(name for name in (*names, *REFERENCE) if name != "README")
    return f"\n```{{toctree}}\n:hidden:\n:maxdepth: 1\n\n{listed}\n```\n"


def stage(source: Path) -> None:
    """Lay out what Sphinx reads."""
    shown = set(pages())
    for page in shown:
        text = page.read_text()
        target = source / page.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        for link in LINK.findall(text):
            file = (page.parent / link).resolve()
            if file.is_file() and file not in shown:
                copy = source / file.relative_to(ROOT)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, copy)
        target.write_text(text + (contents() if page == ROOT / "README.md" else ""))
    for name, text in (*command_pages(), ("configuration", configuration_page())):
        file = source / "reference" / f"{name}.md"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    apidoc.main(
        [
            *("-q", "--separate", "--module-first", "--maxdepth", "2"),
            *("-o", str(source / "api"), str(ROOT / "koopman_lab")),
        ]
    )


def build(out: Path) -> int:
    """Build the site; return the exit code. A page that Sphinx warns of is no page."""
    source = out.parent / f"{out.name}-source"
    for folder in (out, source):
        shutil.rmtree(folder, ignore_errors=True)
    stage(source)
    # In one process: what pydantic still lacks of a class depends on who imports it first.
    code = build_main(
        [
            *("-q", "-W", "--keep-going", "-c", str(HERE)),
            *("-d", str(out.parent / f"{out.name}-doctrees"), str(source), str(out)),
        ]
    )
    if code == 0:
        (out / "index.html").write_text(FRONT)
        print(f"{out / 'index.html'}")
    return code


def main() -> None:
    """Build it into the folder that was named."""
    parser = argparse.ArgumentParser(description="Build the site of the documentation.")
    parser.add_argument("--out", type=Path, default=DEFAULT, metavar="DIR")
    sys.exit(build(parser.parse_args().out.resolve()))


if __name__ == "__main__":
    main()
