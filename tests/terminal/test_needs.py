"""What a command needs is said beside it, checked before it begins, and told by its help."""

import inspect

import pytest
import typer
from typer.testing import CliRunner

from koopman_lab import installation
from koopman_lab.errors import InstallationError
from koopman_lab.installation import install_command, missing, packages, require
from offboard.cli.main import app
from offboard.terminal.needs import commands, needs, needs_of

COMMANDS = dict(commands(typer.main.get_command(app)))
DESK = {"casadi", "scipy", "matplotlib", "joblib", "starlette", "uvicorn", "websockets"}


@pytest.fixture
def without(monkeypatch):
    """Let a package be absent."""

    def leave_out(name):
        there = installation._is_installed
        monkeypatch.setattr(installation, "_is_installed", lambda n: n != name and there(n))

    return leave_out


def test_the_desk_is_what_the_metadata_says_and_other_extras_build_on_it():
    assert set(packages("desk")) == DESK
    optional = ("mcap", "ros2", "parquet", "foxglove", "cluster", "edmd", "bench", "rl")
    for extra in (*optional, "test", "dev"):
        assert set(packages(extra)) > DESK, extra


def test_what_is_required_is_named_with_the_command_that_installs_it(without):
    require("desk", "a park")
    without("casadi")
    assert missing("desk") == ("casadi",)
    with pytest.raises(InstallationError, match=r"a park needs .*\(casadi\).*koopman-lab\[desk\]"):
        require("desk", "a park")


@pytest.mark.parametrize("words", COMMANDS)
def test_each_extra_that_a_command_needs_is_one(words):
    for need in needs_of(COMMANDS[words].callback):
        assert packages(need.extra), f"{words}: no extra {need.extra}"
        name, *_ = need.option.split() or [None]
        options = {option for parameter in COMMANDS[words].params for option in parameter.opts}
        assert name is None or name in options


def sample(ran):
    @needs("cluster", "--far", lambda options: options["far"])
    @needs("desk")
    def work(far: bool = False, times: int = 1) -> None:
        """Work.

        Example: klab work
        """
        ran.append((far, times))

    return work


def test_a_marked_command_keeps_its_options_and_tells_what_it_needs():
    ran = []
    work = sample(ran)
    assert list(inspect.signature(work).parameters) == ["far", "times"]
    assert [need.extra for need in needs_of(work)] == ["cluster", "desk"]
    told = inspect.getdoc(work)
    for extra in ("desk", "cluster"):
        assert told.index(install_command(extra)) < told.index("Example: klab work")
    one = typer.Typer()
    one.command()(work)
    assert CliRunner().invoke(one, ["--times", "3"]).exit_code == 0
    assert ran == [(False, 3)]


@pytest.mark.parametrize(
    ("absent", "arguments", "runs"),
    [
        ("casadi", {}, False),
        ("casadi", {"far": True}, False),
        ("distributed", {}, True),
        ("distributed", {"far": False}, True),
        ("distributed", {"far": True}, False),
        ("none", {"far": True}, True),
    ],
)
def test_a_command_runs_only_with_what_it_needs_for_what_is_asked(without, absent, arguments, runs):
    ran = []
    without(absent)
    if runs:
        sample(ran)(**arguments)
    else:
        with pytest.raises(InstallationError, match=absent):
            sample(ran)(**arguments)
    assert bool(ran) is runs
