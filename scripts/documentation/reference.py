"""Pages of the site that are made from the code: every command, and every setting."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from click import Context

import koopman_lab.config
from offboard.cli.main import app
from offboard.terminal.needs import commands

DEFAULTS = Path(koopman_lab.config.__file__).with_name("defaults")
WIDTH = 88
LAYERS = {
    "base": "What all robots share, with the preset `lab`.",
    "kinematic": "The kinematic robot: what it has beside the above.",
    "dynamic": "The second-order robot: what it has beside the above.",
    "ideal": "The preset `ideal`: what it changes.",
    "harsh": "The preset `harsh`: what it changes.",
    "real": "The preset `real`: what it changes.",
}
"""The files of the default configuration, by what they are for."""


def command_pages() -> Iterator[tuple[str, str]]:
    """Give the page of all commands: its name and text."""
    whole = typer.main.get_command(app)
    parts = ["# Commands\n\nAs `klab COMMAND --help` says it.\n"]
    for words, command in commands(whole):
        if not command.hidden:
            parts.append(f"## klab {words}\n\n```text\n{_help_of(command, words)}\n```\n")
    yield "commands", "\n".join(parts)


def _help_of(command: Any, words: str) -> str:
    context = Context(command, info_name=f"klab {words}", terminal_width=WIDTH)
    return str(command.get_help(context)).rstrip()


def configuration_page() -> str:
    """Return the page of all settings."""
    parts = [
        "# Configuration\n\nEvery setting with its default, unit and source, as the software "
        "reads it. `--set sampler.segments_per_basis=20` sets one; a file given with `--config` "
        "holds any part of it; `klab config check` says whether it can be used.\n"
    ]
    files = {file.stem: file for file in DEFAULTS.glob("*.yaml")}
    for name in (*LAYERS, *sorted(files.keys() - LAYERS.keys())):
        about = LAYERS.get(name, f"`{name}`")
        parts.append(f"## {name}\n\n{about}\n\n```yaml\n{files[name].read_text()}```\n")
    return "\n".join(parts)
