"""The guard: nothing moves whose motion nobody understands, and nothing leaves the floor.

Every node of the desk that drives a robot asks it before each command. It believes no stream
because it is fresh: frames must be of now, new, and where the robot can be; cameras, wheels and
commands must tell of one motion; and the robot must be able to stop inside the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from koopman_lab.bus.age import is_current
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import REST, Velocity
from koopman_lab.robots.table import robot_type
from offboard.desk.floor import Floor
from offboard.desk.frame_gate import FrameGate
from offboard.desk.interlock import Interlock
from offboard.desk.measurements import Frame, WheelSpeeds
from offboard.desk.motion_check import MotionCheck

SHORTEST_STEP_US = 20_000
"""Over less a speed is noise."""
OLDEST_WHEELS_US = 500_000
"""An older speed of the wheels says nothing of now."""


class Guard:
    """Judges in each control step whether the robot may be driven.

    Parameters
    ----------
    config
        The lab.
    timeout_s
        Age over which a camera frame counts for nothing (s).
    lever_m
        How far the tracked point may be from the axle's middle (m); None where nobody knows.
    by_hand
        Whether a person drives, who may bring a robot back that stands outside the floor.
    """

    def __init__(
        self,
        config: LabConfig,
        timeout_s: float,
        *,
        lever_m: float | None = None,
        by_hand: bool = False,
    ) -> None:
        self._gate = FrameGate(config, timeout_s)
        self._floor = Floor(config, by_hand=by_hand)
        # What has no wheels tells of none.
        self._check = (
            None if robot_type(config.robot.kind).drive is None else MotionCheck(config, lever_m)
        )
        self._rolled = REST
        self._wheels: WheelSpeeds | None = None
        self._seen_m_per_s = 0.0

    def tracked(self, now_us: int) -> Frame | None:
        """Return the newest frame that could be believed, None while tracking is lost."""
        return None if self._gate.interlock(now_us) else self._gate.believed

    def see_wheels(self, wheels: WheelSpeeds) -> None:
        """Take wheel odometry."""
        if not all(map(math.isfinite, wheels.velocity)):
            return
        self._wheels = wheels
        if self._check is not None:
            rolled = self._check.see_wheels(wheels)
            self._rolled = Velocity(self._rolled.v + rolled.v, self._rolled.omega + rolled.omega)

    def see_setpoint(self, setpoint: Velocity, now_us: int) -> None:
        """Take what the motor loop says that it aims at."""
        if self._check is not None:
            self._check.see_setpoint(setpoint, now_us)

    def see_frames(
        self, newest_first: Iterable[Frame], now_us: int, *, driving: bool
    ) -> Frame | None:
        """Take the frames since the last step, the newest first; return one that is believed.

        None if there is none. A robot that is not ``driving`` may be carried.
        """
        before = self._gate.believed
        frame = self._gate.update(newest_first, now_us, self._rolled, driving=driving)
        self._rolled = REST
        if frame is None:
            return None
        if self._gate.relocated:
            self._seen_m_per_s = 0.0
            if self._check is not None:
                self._check.restart()
        elif before is not None and frame.utime - before.utime >= SHORTEST_STEP_US:
            self._seen_m_per_s = _forward_m_per_s(before, frame)
        if self._check is not None:
            self._check.see_frame(frame)
        return frame

    def interlock(self, now_us: int, *, driving: bool) -> Interlock | None:
        """Return why the robot must not be driven, None if it may be."""
        interlock = self._gate.interlock(now_us)
        if interlock is None and self._check is not None:
            interlock = self._check.interlock(now_us, driving=driving)
        frame = self._gate.believed
        if interlock is not None or frame is None:
            return interlock
        # Wheels may lie, and cameras be late: it must be able to stop by either.
        by_wheels = 0.0
        if self._wheels is not None and is_current(self._wheels.utime, now_us, OLDEST_WHEELS_US):
            by_wheels = self._wheels.velocity.v
        return self._floor.interlock(frame.pose, self._seen_m_per_s) or self._floor.interlock(
            frame.pose, by_wheels
        )


def _forward_m_per_s(before: Frame, after: Frame) -> float:
    """Return the forward speed between two frames (m/s)."""
    theta = after.pose.theta
    way = (after.pose.x1 - before.pose.x1) * math.cos(theta) + (
        after.pose.x2 - before.pose.x2
    ) * math.sin(theta)
    return way * 1e6 / (after.utime - before.utime)
