"""The tables of drivers and camera bridges: what speaks for motors and for cameras.

A driver listens to MOTOR_CMD and speaks ENCODER; a camera bridge speaks MOCAP_POSE. Nobody else
knows which one it is, or whether a plant stands in for both.

Another package adds one by an entry point of the group ``koopman_lab.drivers`` or
``koopman_lab.cameras``, whose name is what a person types and whose value a :class:`Hardware`::

    [project.entry-points."koopman_lab.drivers"]
    acme = "my_package.row:ACME"

    # my_package/row.py, which imports nothing heavy
    ACME = Hardware("acme", "my_package.driver:Driver", "driver", needs="a board on /dev/ttyACM0")

`klab run driver --driver acme` runs it, and `klab run mocap --driver acme` a camera bridge of that
name. A driver brakes by itself when no MOTOR_CMD arrives for a while: nobody else can stop the
motors once the motor loop is gone. A camera bridge stamps poses with the time when the cameras saw
them, by the clock of the desk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from koopman_lab.bus.node import Node
from koopman_lab.errors import PluginError
from koopman_lab.registry import Registry

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


@dataclass(frozen=True)
class Hardware:
    """One driver or camera bridge.

    Attributes
    ----------
    name
        As in ``--driver NAME``.
    factory
        Takes the configuration and returns the node. A callable, or where it is, as
        ``module:attribute``, so that what it imports is imported only where it runs.
    process
        The process that the node runs in, after which it is named: ``driver``, ``mocap``, or
        ``plant``.
    needs
        What must be there, in words for the help: a port, a package to install.
    """

    name: str
    factory: str | Callable[[LabConfig], Node]
    process: str
    needs: str = ""


def build_hardware(table: Registry[Hardware], name: str, config: LabConfig) -> Node:
    """Return the node of a row.

    Raises
    ------
    ConfigError
        If there is no such row.
    PluginError
        If it is another package's, and cannot be used.
    """
    row = table.get(name)
    node: Node = table.load(name, row.factory)(config)
    if node.name != row.process:
        raise PluginError(
            f"{table.origin(name)}: its node calls itself {node.name!r}, expected "
            f"{row.process!r}, whose heartbeat the others know; mend or uninstall it"
        )
    return node


DRIVERS: Registry[Hardware] = Registry(
    "driver",
    "koopman_lab.drivers",
    Hardware,
    {"plant": Hardware("plant", "onboard.plant.simulated_robot:SimulatedRobot", "plant")},
)
CAMERAS: Registry[Hardware] = Registry(
    "camera bridge",
    "koopman_lab.cameras",
    Hardware,
    {
        "plant": Hardware(
            "plant",
            "onboard.plant.cameras.watched_robot:CameraBridge",
            "mocap",
            needs="`klab run driver --driver plant`",
        )
    },
)
driver = partial(build_hardware, DRIVERS)
"""Returns the node of a driver, by its name, for a configuration."""
mocap = partial(build_hardware, CAMERAS)
"""Returns the node of a camera bridge, by its name, for a configuration."""
