"""`scripts/mutate` on a room of a few lines, of which its tests notice this and not that."""

import os
import shutil
import subprocess

import pytest
from checkout import ROOT, checkout

CODE = '''"""A room."""


def total(a, b):
    """Add."""
    # The line that is changed is not the first of the function.
    return a + b


class Limit:
    """Has a method of a name that a function has, too."""

    def total(self, x):
        """Compare, on more than one line."""
        return (
            x <
            10
        )

    def unused(self, x):
        """Is called by no test."""
        return not x
'''
TESTS = """from toy.room.sums import Limit, total


def test_total():
    assert total(2, 3) == 5


def test_limit():
    assert Limit().total(1)
    assert not Limit().total(100)
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Make a repository with the scripts, and one room."""
    place = tmp_path_factory.mktemp("place")
    checkout(place)
    shutil.copy(ROOT / ".gitignore", place)
    (place / "toy" / "room").mkdir(parents=True)
    (place / "toy" / "room" / "sums.py").write_text(CODE)
    (place / "tests" / "room").mkdir(parents=True)
    (place / "tests" / "room" / "test_sums.py").write_text(TESTS)
    (place / "temporary").mkdir()
    subprocess.run(["git", "init", "--quiet"], cwd=place, check=True)
    subprocess.run(["git", "add", "--all"], cwd=place, check=True)
    return place


def mutate(place, *arguments):
    return subprocess.run(
        ["bash", place / "scripts" / "mutate", *arguments],
        env=os.environ | {"TMPDIR": str(place / "temporary")},
        capture_output=True,
        text=True,
        check=False,
    )


def line_of(code):
    return next(k for k, line in enumerate(CODE.splitlines(), 1) if code in line)


def test_what_no_test_notices_is_named_with_its_line_and_nothing_stays_behind(place):
    def files():
        return {f for f in place.rglob("*") if ".venv" not in f.parts and ".git" not in f.parts}

    before = files()
    done = mutate(place, "toy/room")
    assert done.returncode == 0, done.stderr
    at = f"toy/room/sums.py:{line_of('x <')}: survived"
    assert f"{at}: x <= 10\n    instead of: x < 10\n" in done.stdout
    at = f"toy/room/sums.py:{line_of('10')}: survived"
    assert f"{at}: 11\n    instead of: 10\n" in done.stdout
    at = f"toy/room/sums.py:{line_of('not x')}: no test"
    assert f"{at}: return x\n    instead of: return not x\n" in done.stdout
    assert "a - b" not in done.stdout
    assert "toy/room: 1 killed, 2 survived, 1 no test, 0 not tried\n" in done.stdout
    assert files() == before
    assert not any((place / "temporary").iterdir())


def test_a_share_of_the_mutants_against_tests_of_ones_own_choice(place):
    asked = ("toy/room/sums.py", "--share", "0.5", "--tests", "tests/room/test_sums.py")
    first, again = mutate(place, *asked), mutate(place, *asked)
    assert first.returncode == 0, first.stderr
    assert "2 of 4 mutants, against tests/room/test_sums.py" in first.stdout
    assert first.stdout == again.stdout


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("toy/rom",), "toy/rom, or one of its tests (tests/toy), is not here"),
        (("toy/room", "--tests", "tests/none"), "tests/none"),
        (("toy/room", "--share", "2"), "--share"),
    ],
)
def test_a_mistake_is_one_line_and_changes_nothing(place, arguments, told):
    done = mutate(place, *arguments)
    assert done.returncode == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout


def test_tests_that_fail_without_a_mutant_are_shown(place, tmp_path):
    broken = tmp_path / "test_broken.py"
    broken.write_text(
        "from toy.room.sums import total\n\ndef test_it():\n    assert total(1, 1) == 3\n"
    )
    done = mutate(place, "toy/room", "--tests", str(broken))
    assert done.returncode == 1
    assert "assert total(1, 1) == 3" in done.stderr
