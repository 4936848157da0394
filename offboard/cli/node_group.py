"""Commands of `klab run`: those of our own nodes, and one for each node that other packages add."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer

from koopman_lab.robots.table import DEFAULT_ROBOT
from offboard.terminal import options
from offboard.terminal.choices import Commands, Group


class NodeGroup(Group):
    """Our own commands, and behind them one for each node of another package.

    Such a command is made when it is run or listed; the package is imported only when it is run.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all nodes."""
        from koopman_lab.bus.processes import PROCESSES

        names = super().list_commands(ctx)
        return [*names, *(name for name in PROCESSES.plugin_names() if name not in names)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a node; None if there is no such node."""
        from koopman_lab.bus.processes import PROCESSES

        command = super().get_command(ctx, cmd_name)
        return (
            _command(cmd_name)
            if command is None and cmd_name in PROCESSES.plugin_names()
            else command
        )


def _command(name: str) -> Any:
    """Return the command that runs a node of another package."""
    from koopman_lab.bus.processes import PROCESSES, build

    app = Commands(add_completion=False)
    example = f"Example: klab run {name} --robot {DEFAULT_ROBOT}"
    text = f"Run the {PROCESSES.origin(name)}.\n\n{example}"
    app.command(name, help=text)(node_command(lambda lab: build(name, lab)))
    return typer.main.get_command(app)


def node_command(make: Callable[[Any], Any]) -> Callable[..., None]:
    """Return a command that runs a node which needs nothing but the configuration.

    Parameters
    ----------
    make
        Returns the node for a configuration.
    """

    def run(
        config: options.ConfigFile = None,
        overrides: options.Overrides = None,
        robot: options.Robot = None,
        preset: options.Preset = options.PresetName.lab,
        robot_name: options.RobotsName = None,
        url: options.Url = None,
        lifeline_fd: options.Lifeline = None,
    ) -> None:
        from koopman_lab.bus.realtime import run_node

        lab = options.resolve(config, overrides, robot, preset, url=url, robot_name=robot_name)
        run_node(make(lab), lab, lifeline_fd=lifeline_fd)

    return run
