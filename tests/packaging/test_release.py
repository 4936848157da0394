"""What a release says of itself: its version by the tag, the change log, how to cite it."""

import json
import os
import re
import subprocess
import sys
import tarfile
from importlib.metadata import metadata
from pathlib import Path

import pytest
from packaging.version import Version

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from change_log import CHANGE_LOG, KINDS, entries, main  # noqa: E402
from dependencies import PYTHONS  # noqa: E402

PYPROJECT = (ROOT / "pyproject.toml").read_text()
(FALLBACK,) = re.findall(r'^fallback-version = "(.*)"$', PYPROJECT, re.MULTILINE)
PERSON = {
    **{f"GIT_{role}_NAME": "Somebody" for role in ("AUTHOR", "COMMITTER")},
    **{f"GIT_{role}_EMAIL": "somebody@example.org" for role in ("AUTHOR", "COMMITTER")},
    **{"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull},
}


def run(*words: str | Path, cwd: Path) -> str:
    """Run a program, without what the environment says of versions; return what it printed."""
    clean = {k: v for k, v in os.environ.items() if "SCM" not in k and "VCS" not in k}
    done = subprocess.run(
        words, cwd=cwd, env=clean | PERSON, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout.strip()


def version_in(folder: Path) -> str:
    """Return the version that a build in a folder would have."""
    return run(sys.executable, "-m", "hatchling", "metadata", "version", cwd=folder)


def unpacked(archive: Path, into: Path) -> Path:
    """Unpack an archive with one folder at its top; return that."""
    with tarfile.open(archive) as file:
        file.extractall(into, filter="data")
    (folder,) = into.iterdir()
    return folder


@pytest.fixture
def clone(tmp_path):
    """Give a clone without any tag, as a clean one of a branch may be."""
    folder = tmp_path / "clone"
    run("git", "clone", "--quiet", "--no-tags", ROOT, folder, cwd=tmp_path)
    return folder


def test_a_clone_without_tags_is_behind_the_last_version_by_all_of_its_commits(clone):
    version = Version(version_in(clone))
    commits = run("git", "rev-list", "--count", "HEAD", cwd=clone)
    assert version.public == f"{FALLBACK}.post1.dev{commits}"
    assert run("git", "rev-parse", "HEAD", cwd=clone).startswith(version.local[1:])
    assert version > Version(FALLBACK)  # what packages say that they need is fulfilled


def test_a_tag_is_the_version_and_what_follows_is_behind_it(clone, tmp_path):
    run("git", "tag", "results-2026.5", cwd=clone)  # a number, but no version
    run("git", "tag", "v7.8.9", cwd=clone)
    assert version_in(clone) == "7.8.9"
    archive = tmp_path / "archive.tar"
    run("git", "archive", "--prefix=lab/", f"--output={archive}", "v7.8.9", cwd=clone)
    assert version_in(unpacked(archive, tmp_path / "archived")) == "7.8.9"

    (clone / "README.md").write_text("changed\n")
    assert Version(version_in(clone)).public == "7.8.9.post1.dev0"
    run("git", "commit", "--quiet", "--all", "--message", "Change", cwd=clone)
    assert Version(version_in(clone)).public == "7.8.9.post1.dev1"

    run(sys.executable, "-m", "hatchling", "build", "--target", "sdist", cwd=clone)
    (source,) = (clone / "dist").iterdir()
    assert version_in(unpacked(source, tmp_path / "source")) == version_in(clone)


def test_an_archive_of_a_commit_without_tags_says_the_last_version(clone, tmp_path):
    archive = tmp_path / "archive.tar"
    run("git", "archive", "--prefix=lab/", f"--output={archive}", "HEAD", cwd=clone)
    assert Version(version_in(unpacked(archive, tmp_path / "archived"))).base_version == FALLBACK


def test_the_change_log_has_its_form_and_its_newest_version_stands_in_for_a_tag():
    unreleased, newest, *_ = entries(CHANGE_LOG.read_text())
    assert unreleased.version is None
    assert newest.version == Version(FALLBACK)


LOG = """# Change log

## [Unreleased]

## [0.2.0] - 2027-01-31

### Added

- One thing.

### Fixed

- Another
  thing.

## [0.1.0] - 2026-12-31

The first one.

### Added

- Everything.
"""


def test_the_change_log_is_read_by_version_and_kind():
    unreleased, second, first = entries(LOG)
    assert (unreleased.changes, unreleased.date) == ({}, None)
    assert second.version == Version("0.2.0")
    assert second.changes == {"Added": "- One thing.", "Fixed": "- Another\n  thing."}
    assert second.text == "### Added\n\n- One thing.\n\n### Fixed\n\n- Another\n  thing."
    assert f"{first.version} {first.date}" == "0.1.0 2026-12-31"
    assert first.text == "The first one.\n\n### Added\n\n- Everything."


@pytest.mark.parametrize(
    ("part", "other", "words"),
    [
        ("## [Unreleased]\n", "", "the first heading, and no other"),
        ("[0.1.0] - 2026-12-31", "[Unreleased]", "the first heading, and no other"),
        ("[0.1.0]", "[0.3.0]", "from the newest to the oldest"),
        ("[0.1.0]", "[0.2.0]", "from the newest to the oldest"),
        ("2026-12-31", "2027-02-01", "from the newest to the oldest"),
        ("2026-12-31", "31.12.2026", "isoformat"),
        (" - 2026-12-31", "", "has a date and changes"),
        ("- Everything.", "Everything.", "list items below their kind"),
        ("### Added\n\n- Everything.", "- Everything.", "list items below their kind"),
        ("### Added\n\n- Everything.", "", "has a date and changes"),
        ("### Fixed", "### Mended", r"not \['Mended'\]"),
        ("### Fixed", "### Added", "once at most"),
        ("## [0.1.0]", "## 0.1.0", "is no '## "),
        ("[0.1.0]", "[first]", "first"),
    ],
)
def test_a_change_log_of_another_form_is_refused(part, other, words):
    assert part in LOG
    with pytest.raises(ValueError, match=words):
        entries(other.join(LOG.rsplit(part, 1)))


@pytest.mark.parametrize("name", [FALLBACK, f"v{FALLBACK}"])
def test_the_script_prints_what_is_said_of_a_version_or_its_tag(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["changes", name])
    main()
    printed = capsys.readouterr().out
    assert "### Added\n\n- " in printed
    assert set(re.findall("^### (.*)", printed, re.MULTILINE)) <= set(KINDS)
    assert not re.search("^## ", printed, re.MULTILINE)


@pytest.mark.parametrize("name", ["99.0.0", "v99.0.0", "main"])
def test_the_script_ends_where_nothing_is_said_of_a_version(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["changes", name])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert name in capsys.readouterr().err


def test_the_page_on_contributing_names_what_there_is():
    folder = ROOT / ".github"
    text = (folder / "CONTRIBUTING.md").read_text()
    links = set(re.findall(r"\]\((?!http)([^)#]+)\)", text))
    paths = set(re.findall(r"`((?:\./scripts|koopman_lab|tests)/[\w./]+)", text))
    assert len(links) > 4
    assert len(paths) > 8
    assert not [link for link in links if not (folder / link).exists()]
    assert not [path for path in paths if not (ROOT / path).exists()]


def test_an_index_is_told_all_that_is_known_and_nothing_else():
    about = metadata("koopman-lab")
    supported = [c.rpartition(" ")[2] for c in about.get_all("Classifier") if ":: 3." in c]
    assert supported == [p for p in PYTHONS if p in supported]
    assert about["Requires-Python"] == f">={supported[0]}" == f">={PYTHONS[0]}"
    assert about["License-Expression"] == "MIT"
    assert (ROOT / "LICENSE").read_text().splitlines()[2].endswith(about["Author"])
    assert about["Author"].replace("authors", "maintainers") == about["Maintainer"]
    assert len(about["Keywords"].split(",")) > 5
    assert about.get_all("Project-URL") is None  # there is no place that is known to stay


def test_the_archive_is_told_the_same_as_the_index():
    about, archive = metadata("koopman-lab"), json.loads((ROOT / ".zenodo.json").read_text())
    assert archive["title"] == about["Name"]
    assert archive["description"] == about["Summary"]
    assert archive["creators"] == [{"name": about["Author"]}]
    assert archive["license"] == about["License-Expression"]
    assert set(archive["keywords"]) == set(about["Keywords"].split(","))
    assert archive["upload_type"] == "software"
    (identifier,) = (other["identifier"] for other in archive["related_identifiers"])
    guides = [*ROOT.glob("*.md"), *ROOT.glob("[!.]*/**/*.md")]
    assert any(identifier in guide.read_text() for guide in guides)
