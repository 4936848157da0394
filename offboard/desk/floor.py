"""The allowed area of the floor, and where a robot that brakes now would stand."""

from __future__ import annotations

import math

from koopman_lab.config.sampler import Area
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ConfigError, UsageError
from koopman_lab.geometry.planar import Pose
from offboard.desk.interlock import Cause, Interlock

OTHER_UNIT = 20.0
"""So many floors away stands no robot: its pose is in another unit."""
TOO_FAST = 2.0
"""So many times as fast as it may be is no robot."""
UNIT_HINT = "; the cameras send another unit than m, or see another body"
BY_HAND_M_PER_S = 0.1
"""A robot that stands outside is driven back in no faster, and by a person only."""


def excess_m(area: Area, x1: float, x2: float) -> float:
    """Return how far a point (m) lies outside an area; 0 inside of it."""
    (low1, high1), (low2, high2) = area.x1_m, area.x2_m
    return math.hypot(max(low1 - x1, 0.0, x1 - high1), max(low2 - x2, 0.0, x2 - high2))


def require_on_floor(pose: Pose, floor: Area, what: str = "goal") -> None:
    """Refuse a pose that is none, or outside the floor.

    Parameters
    ----------
    pose
        In the inertial frame.
    floor
        Where the robot may be driven.
    what
        What the pose is, in a word for a person.

    Raises
    ------
    UsageError
        With the pose, the bounds and the key that sets them.
    """
    if not all(map(math.isfinite, pose)):
        raise UsageError(f"{what}: a pose needs three numbers, x1 and x2 in m and an angle")
    for name, value, (low, high) in (
        ("x1", pose.x1, floor.x1_m),
        ("x2", pose.x2, floor.x2_m),
    ):
        if not low <= value <= high:
            raise UsageError(
                f"{what}: {name} = {value:g} m is outside [{low:g}, {high:g}] m; choose another, "
                f"or enlarge floor.{name}_m if the floor is free there"
            )


def require_sets_on_floor(config: LabConfig) -> None:
    """Refuse sets of the sampler that reach beyond the floor.

    Raises
    ------
    ConfigError
        With the set, the floor and the keys that set them.
    """
    for name in ("draw_set", "admissible_set"):
        for side in ("x1_m", "x2_m"):
            low, high = getattr(getattr(config.sampler, name), side)
            floor_low, floor_high = getattr(config.floor, side)
            if not floor_low <= low <= high <= floor_high:
                raise ConfigError(
                    f"sampler.{name}.{side}: [{low:g}, {high:g}] m reaches beyond the floor, "
                    f"[{floor_low:g}, {floor_high:g}] m; make it smaller, or enlarge floor.{side} "
                    "if the floor is free there"
                )


class Floor:
    """Judges whether a robot may go on as it moves.

    Parameters
    ----------
    config
        The area, the limits of the motor loop, and how long a command may be on its way.
    by_hand
        Whether a person drives, who may bring a robot back that stands outside.
    """

    def __init__(self, config: LabConfig, *, by_hand: bool = False) -> None:
        self._area = config.floor
        loop = config.motor_loop
        # The slowest way to a stop: no command arrives any more, and the watchdog has to wait.
        self._reaction_s = loop.watchdog_s + config.controller.dt_s
        self._braking_m_per_s2 = loop.limits.a_m_per_s2
        self._fastest_m_per_s = TOO_FAST * loop.limits.v_m_per_s
        self._by_hand = by_hand

    def braking_m(self, v_m_per_s: float) -> float:
        """Return the way (m) on which a robot at this speed (m/s) comes to rest, signed like it."""
        speed = abs(v_m_per_s)
        way = speed * self._reaction_s + speed * speed / (2.0 * self._braking_m_per_s2)
        return math.copysign(way, v_m_per_s)

    def interlock(self, pose: Pose, v_m_per_s: float) -> Interlock | None:
        """Return why a robot at a pose and forward speed (m/s) must not drive on, None if it may.

        Whoever stands inside may drive as long as it could stop inside. Whoever stands outside may
        only be driven back, slowly and by hand.
        """
        way = self.braking_m(v_m_per_s)
        end1, end2 = pose.x1 + way * math.cos(pose.theta), pose.x2 + way * math.sin(pose.theta)
        (low1, high1), (low2, high2) = self._area.x1_m, self._area.x2_m
        stops_inside = low1 <= end1 <= high1 and low2 <= end2 <= high2
        excess = excess_m(self._area, pose.x1, pose.x2)
        if excess == 0.0 and stops_inside:
            return None
        if excess == 0.0:
            hint = UNIT_HINT if abs(v_m_per_s) > self._fastest_m_per_s else ""
            leaves = f"about to leave the floor at {v_m_per_s:.2f} m/s, {self._place(pose)}{hint}"
            return Interlock(leaves, lasting=True, cause=Cause.FLOOR)
        comes_back = excess_m(self._area, end1, end2) <= excess
        if self._by_hand and comes_back and abs(v_m_per_s) <= BY_HAND_M_PER_S:
            return None
        outside = f"outside the floor, {self._place(pose)}{self._hint(excess)}"
        return Interlock(outside, lasting=True, cause=Cause.FLOOR)

    def _place(self, pose: Pose) -> str:
        (low1, high1), (low2, high2) = self._area.x1_m, self._area.x2_m
        return (
            f"at x1 = {pose.x1:.2f} m, x2 = {pose.x2:.2f} m; it ends at [{low1:g}, {high1:g}] m, "
            f"[{low2:g}, {high2:g}] m (floor.x1_m, floor.x2_m)"
        )

    def _hint(self, excess: float) -> str:
        (low1, high1), (low2, high2) = self._area.x1_m, self._area.x2_m
        if excess > OTHER_UNIT * max(high1 - low1, high2 - low2):
            return UNIT_HINT
        return "; place the robot inside, or see whether the axes of the cameras' frame are right"
