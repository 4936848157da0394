"""The one table of kinds of robots, by the names that configurations and commands use."""

from __future__ import annotations

from koopman_lab.registry import Registry
from koopman_lab.robots.robot_type import RobotType

ROBOTS: Registry[RobotType] = Registry(
    "robot",
    "koopman_lab.robots",
    RobotType,
    {
        "kinematic": "koopman_lab.robots.kinematic:KINEMATIC",
        "dynamic": "koopman_lab.robots.dynamic:DYNAMIC",
    },
)
DEFAULT_ROBOT = "kinematic"
"""The kind of robot of a lab that says none."""


def robot_type(name: str) -> RobotType:
    """Return the kind of robot of a name, our own whatever other packages add.

    Every command asks, an emergency stop as well: it neither looks for packages nor fails where one
    has taken a name of ours. Who names a robot on the command line is told of that.

    Raises
    ------
    ConfigError
        If there is none; the message lists the known ones.
    PluginError
        If it is another package's, and cannot be used.
    """
    return ROBOTS.builtin_row(name) or ROBOTS.get(name)
