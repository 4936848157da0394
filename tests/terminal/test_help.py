"""What the help says: under headings, in plain words, and none of it cut at 80 columns."""

import re
from typing import Annotated

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from klab import klab_here
from typer.testing import CliRunner

from koopman_lab.errors import LabError
from offboard.cli.command_table import COMMANDS, DRIVE, LEARN, LOGS, MEASURE, RUN
from offboard.cli.main import command_line
from offboard.terminal.choices import Commands
from offboard.terminal.exit_codes import MEANINGS, ExitCode, code_of
from offboard.terminal.needs import commands

WIDTH = 80
JARGON = re.compile(r"<(int|float|str|integer|bool)\b|\b(INTEGER|FLOAT|TEXT|RANGE)\b|x>=")


def help_of(*words):
    done = klab_here(*words, "--help")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_command_stands_under_its_heading_in_one_line_of_80_columns():
    sections = re.split(r"\n\n(?=\S.*:\n)", help_of())
    by_heading = {s.partition(":\n")[0]: s.partition(":\n")[2].splitlines() for s in sections}
    for heading in (RUN, LEARN, DRIVE, LOGS, MEASURE):
        rows = [(n, r.short_help) for n, r in COMMANDS.items() if r.heading == heading]
        lines = [line.strip() for line in by_heading[heading]]
        assert [re.split(r"\s{2,}", line) for line in lines] == [list(row) for row in rows]
        assert max(map(len, by_heading[heading])) <= WIDTH


def test_each_exit_code_has_one_meaning_and_the_help_says_it():
    told = " ".join(help_of().split())
    for code, meaning in MEANINGS.items():
        assert f"{int(code)} {meaning}" in told
    assert set(MEANINGS) == set(ExitCode)
    assert len(set(MEANINGS.values())) == len(MEANINGS)


def errors(base=LabError):
    yield base
    for kind in base.__subclasses__():
        yield from errors(kind)


@pytest.mark.parametrize("kind", sorted(set(errors()), key=lambda kind: kind.__name__))
def test_every_expected_mistake_is_a_misuse_or_a_failure_of_the_lab(kind):
    assert code_of(kind.__new__(kind)) in (ExitCode.MISUSE, ExitCode.LAB_FAILURE)


@pytest.mark.parametrize("group", ["bench", "study", "dataset", "log", "run", "config"])
def test_a_group_says_the_whole_first_sentence_of_each_command(group):
    told = " ".join(help_of(group).split())
    for words, command in commands(command_line().commands[group]):
        if not command.hidden:
            sentence = " ".join(command.help.partition("\n\n")[0].split())
            assert f"{words} {sentence}" in told


def test_every_command_calls_values_in_plain_words_and_has_an_example():
    for words, command in commands(command_line()):
        told = help_of(*words.split())
        assert not JARGON.search(told), words
        assert max(map(len, told.splitlines())) <= WIDTH, words
        assert command.hidden or f"Example: klab {words}" in " ".join(told.split()), words


def test_the_version_is_said():
    done = klab_here("--version")
    assert done.returncode == 0
    assert re.fullmatch(r"klab \d+\.\d+\S*\n", done.stdout)


def reading():
    """Return a command line with a command that takes numbers in every way, and what it read."""
    read = []
    app = Commands()

    @app.command()
    def move(
        count: int,
        pose: tuple[float, float, float],
        more: Annotated[list[float] | None, typer.Argument()] = None,
        speed: float = typer.Option(0.0, "--speed"),
        goal: tuple[float, float] = typer.Option((0.0, 0.0), "--goal"),
        word: str = typer.Option("", "--word"),
        slow: bool = typer.Option(False, "--slow"),
    ) -> None:
        read.append((count, *pose, *(more or ()), speed, *goal, word, slow))

    return app, read


numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(
    count=st.integers(-(2**40), 2**40),
    pose=st.lists(numbers, min_size=3, max_size=3),
    more=st.lists(numbers, max_size=3),
    speed=numbers,
    goal=st.lists(numbers, min_size=2, max_size=2),
    word=st.sampled_from(["-1", "-0.5", "x", "-.5"]),
    slow=st.booleans(),
    order=st.permutations(range(4)),
)
def test_numbers_may_be_negative_wherever_they_stand(
    count, pose, more, speed, goal, word, slow, order
):
    """Behind an option they are its values as before, also where they are words there."""
    app, read = reading()
    options = [
        ["--speed", repr(speed)],
        ["--goal", *map(repr, goal)],
        ["--word", word],
        ["--slow"] if slow else [],
    ]
    first, second, *rest = (options[k] for k in order)
    typed = [*first, str(count), *map(repr, pose), *second, *map(repr, more), *rest[0], *rest[1]]
    done = CliRunner().invoke(app, typed)
    assert done.exit_code == 0, done.output
    assert read == [(count, *pose, *more, speed, *goal, word, slow)]


@pytest.mark.parametrize("typed", [["-x", "1", "2", "3"], ["--spede", "-1"], ["1", "-a", "0", "0"]])
def test_what_is_no_number_is_an_option_as_before(typed):
    app, read = reading()
    done = CliRunner().invoke(app, typed)
    assert (done.exit_code, read) == (2, [])
    assert "No such option" in done.output


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_numbers_that_are_none_are_refused_by_every_option(value):
    app, read = reading()
    for typed in (
        ["1", "0", value, "0"],
        ["1", "0", "0", "0", value],
        ["1", "0", "0", "0", "--speed", value],
        ["1", "0", "0", "0", "--goal", "0", value],
    ):
        done = CliRunner().invoke(app, typed)
        assert (done.exit_code, read) == (2, []), typed
        assert f"{value} is no number" in done.output
