"""What one row of the table of faults is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from koopman_lab.config.simulation import Fault
from koopman_lab.robots.robot_type import RobotType
from offboard.bench.faults.bounds import Bound
from offboard.bench.faults.stage import Activity, Stage


def nothing(stage: Stage) -> None:
    """Strike not at all, where something is wrong from the beginning."""
    del stage


@dataclass(frozen=True)
class Scenario:
    """One row of the table.

    Attributes
    ----------
    name
        What goes wrong.
    strike
        Makes it go wrong while the robot drives fast.
    states
        Beginnings of the states of the motor loop that must come, in this order, after the strike
        or, where something is wrong from the beginning, after the robot first moves.
    bound
        Largest time (s) until the robot stands and goes on standing; None if it must drive on.
    message
        Part of what the operator must read, at once or at the end of the session.
    activity
        What the robot is doing.
    watched_s
        Time after the strike that is looked at.
    by_wheels
        Whether it is for robots whose state takes velocities from the wheels, or for the others;
        None for all.
    wrong
        What is wrong from the beginning.
    """

    name: str
    strike: Callable[[Stage], None]
    states: tuple[str, ...]
    bound: Bound | None = None
    message: str = ""
    activity: Activity = "park"
    watched_s: float = 2.5
    by_wheels: bool | None = None
    wrong: tuple[Fault, ...] = ()

    def is_for(self, robot: RobotType) -> bool:
        """Return whether it means something for a type of robot."""
        return self.by_wheels in (None, bool(robot.speeds_at))
