"""The command line begins without what only some commands need."""

import os
import subprocess
import sys

import pytest
from klab import KLAB, environment

from offboard.cli.command_table import COMMANDS

SAFE = "-P" if sys.version_info >= (3, 11) else "-s"
HEAVY = {
    *("numpy", "scipy", "casadi", "matplotlib", "lcm", "asyncio", "starlette"),
    *("importlib_metadata", "pydantic", "yaml"),
}
LATER = {"koopman_lab.data.decode", "offboard.desk.results", "offboard.controller.node"}
SHOW = "import sys; print('\\n'.join(sys.modules))"
ALL = "from offboard.cli.command_group import CommandsByName; dict(CommandsByName())"


def modules_after(code, **variables):
    done = subprocess.run(
        [sys.executable, SAFE, "-c", f"{code}; {SHOW}"],
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


def test_the_help_and_the_names_of_all_commands_load_none_of_them():
    modules = modules_after("from offboard.cli.main import command_line; command_line()")
    assert not (HEAVY | LATER | {"rich"}) & modules
    assert not {name for name in modules if name.startswith("offboard.commands")}


def test_no_command_waits_for_what_another_one_needs():
    """Whose options are completed is loaded, and nothing that only its work needs."""
    modules = modules_after(ALL)
    assert {row.place.partition(":")[0] for row in COMMANDS.values()} <= modules
    assert not (HEAVY | LATER) & modules


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("klab pa", ["park"]),
        ("klab re", ["relay", "reference", "reproduce", "replay", "rerun"]),
        ("klab config ke", ["keys"]),
        ("klab park --sta", ["--start"]),
        ("klab park --robot dyn", ["dynamic"]),
        ("klab park --model m.npz --cost ", ["me", "ce", "ds"]),
        ("klab calibrate --set controller.horiz", ["controller.horizon="]),
        ("klab --vers", ["--version"]),
    ],
)
def test_the_shell_completes_commands_options_values_and_keys(words, expected):
    asked = {
        "_KLAB_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    done = subprocess.run(KLAB, env=os.environ | asked, capture_output=True, text=True, check=False)
    assert done.stdout.split() == expected, done.stderr
