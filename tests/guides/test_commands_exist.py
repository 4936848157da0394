"""What the guides tell a person to type exists, with these options."""

import pytest
import typer
from guide_pages.pages import LINES, ROOT

from offboard.cli.main import app

KLAB = [line[1:] for line in LINES if line[0] == "klab"]
SCRIPTS = [line[0] for line in LINES if line[0].startswith("./")]


def test_each_klab_command_is_one():
    """Parsed as the command line would be, but not run."""
    whole = typer.main.get_command(app)
    for arguments in KLAB:
        command, rest = whole, list(arguments)
        while hasattr(command, "commands"):
            command = command.commands[rest.pop(0)]
        command.make_context("klab", rest)


@pytest.mark.parametrize("script", sorted(set(SCRIPTS)))
def test_each_script_can_be_run(script):
    assert (ROOT / script).stat().st_mode & 0o100


def test_the_main_jobs_are_told():
    commands = {line[0] for line in KLAB}
    assert {"up", "run", "calibrate", "train", "park", "doctor", "log"} <= commands
    assert {"dataset", "figure", "bench"} <= commands
    assert {"view", "status", "down", "topics"} <= commands
    assert {"./scripts/demo", "./scripts/test", "./scripts/check", "./scripts/docs"} <= set(SCRIPTS)
    assert any(line[:1] == ["lcm-logplayer"] for line in LINES)
