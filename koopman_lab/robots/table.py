"""The one table of robots."""

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
"""Of a lab that says none."""


def robot_type(name: str) -> RobotType:
    """Return the kind of robot of a name.

    Raises
    ------
    ConfigError
        If there is none; the message lists the known ones.
    PluginError
        If it is another package's, and cannot be used.
    """
    return ROBOTS.get(name)
