"""Which camera frames can be believed: those of now, new, and where the robot can be."""

from __future__ import annotations

import math
from collections.abc import Iterable

from koopman_lab.bus.age import is_current, is_fresh
from koopman_lab.bus.channels import MOCAP_POSE
from koopman_lab.bus.stamp_gate import INLETS, clock_text
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose, Velocity, wrap_angle
from koopman_lab.geometry.reach import Reach
from koopman_lab.units import US_PER_S
from offboard.desk.interlock import Cause, Interlock
from offboard.desk.measurements import Frame

STRAY_M, STRAY_RAD = 0.05, 0.2
"""Poses of a robot that stands stray less, whatever the cameras."""
SETTLED_S = 0.3
"""So long the robot must be seen at one place before it is believed to be there: longer than
another body is taken for it now and then."""
MOVED_S = 0.2
"""Who is seen somewhere else for so long is there; no swapped body or flipped axis lasts longer
without a person who has to mend it."""
FROZEN_M, FROZEN_RAD = 0.02, 0.1
"""So far no robot rolls or turns without that a camera sees the least of it."""
NO_FRAMES = "no camera frames"
CLOCK = INLETS[MOCAP_POSE.suffix].clock


class FrameGate:
    """Sorts camera frames, and says what it sees instead of the robot where it sees none.

    Looks at the newest frames of each control step only: who drives needs no others.

    Parameters
    ----------
    config
        How fast the robot can be.
    timeout_s
        Age over which a frame counts for nothing.
    """

    def __init__(self, config: LabConfig, timeout_s: float) -> None:
        limits = config.motor_loop.limits
        # The tracked point may sit as far from the axle's middle as a wheel does.
        lever_m = config.robot.track_width_m
        v_m_per_s = limits.v_m_per_s + lever_m * limits.omega_rad_per_s
        self._reach = Reach(v_m_per_s, limits.omega_rad_per_s, STRAY_M, STRAY_RAD)
        self._timeout_us = round(timeout_s * US_PER_S)
        self.believed: Frame | None = None
        """The newest frame that can be believed."""
        self.relocated = False
        """Whether the newest believed frame shows the robot somewhere else than those before."""
        self._believed_at_us = 0
        self._settled_us: int | None = None
        self._elsewhere: Frame | None = None
        self._elsewhere_since_us = 0
        self._moved = ""
        self._frozen_m = self._frozen_rad = 0.0
        self._sees = ""
        self._heard_us: int | None = None

    @property
    def frozen(self) -> bool:
        """Return whether the pose stays the same to the last bit though the wheels turn."""
        return self._frozen_m > FROZEN_M or self._frozen_rad > FROZEN_RAD

    def update(
        self, newest_first: Iterable[Frame], now_us: int, rolled: Velocity, *, driving: bool
    ) -> Frame | None:
        """Take the frames since the last step; return the newest that can be believed, or None.

        Parameters
        ----------
        newest_first
            In the order that is opposite to that of their arrival; more than the first few are not
            even looked at, as a rule.
        now_us
            Present time (us).
        rolled
            What the wheels have rolled and turned since the last step (m, rad), both positive.
        driving
            Whether the robot is driven. One that is not may be carried.
        """
        for frame in newest_first:
            self._heard_us = now_us
            if self._is_usable(frame, now_us) and self._is_reachable(frame, now_us, driving):
                self._note_frozen(frame, rolled)
                if self._settled_us is None or self.relocated:
                    self._settled_us = now_us + round(SETTLED_S * US_PER_S)
                self.believed, self._believed_at_us = frame, now_us
                return None if self.frozen else frame
        return None

    def interlock(self, now_us: int) -> Interlock | None:
        """Return why the robot's pose is not known, None if it is."""
        if self._moved:
            return Interlock(self._moved, lasting=True, cause=Cause.MOTION)
        if self.frozen:
            frozen = "tracking lost: the pose is frozen, though the wheels turn"
            return Interlock(frozen, cause=Cause.TRACKING)
        frame = self.believed
        if frame is not None and is_fresh(
            frame.utime, self._believed_at_us, now_us, self._timeout_us
        ):
            if self._settled_us is None or now_us >= self._settled_us:
                return None
            return Interlock("tracking begins", cause=Cause.TRACKING)
        heard = self._heard_us is not None and is_current(self._heard_us, now_us, self._timeout_us)
        sees = self._sees if heard else NO_FRAMES
        return Interlock(f"tracking lost: {sees}", cause=Cause.TRACKING)

    def _is_usable(self, frame: Frame, now_us: int) -> bool:
        if not frame.valid:
            self._sees = "the cameras do not see the robot"
        elif not all(map(math.isfinite, frame.pose)):
            self._sees = "the cameras send poses that are no numbers"
        elif not is_current(frame.utime, now_us, self._timeout_us):
            self._sees = clock_text(CLOCK, frame.utime, now_us)
        elif self.believed is not None and frame.utime <= self.believed.utime:
            self._sees = "the camera frames bear no new stamps"
        else:
            return True
        return False

    def _is_reachable(self, frame: Frame, now_us: int, driving: bool) -> bool:
        """Return whether the robot can have come there from where it was believed last."""
        before = self.believed
        self.relocated = False
        if before is None or self._reaches(before, frame):
            self._elsewhere = None
            return True
        if self._elsewhere is None or not self._reaches(self._elsewhere, frame):
            self._elsewhere_since_us = now_us
        self._elsewhere = frame
        jump = jump_text(before.pose, frame.pose)
        self._sees = f"the pose {jump} at once"
        if now_us - self._elsewhere_since_us < MOVED_S * US_PER_S:
            return False
        self._elsewhere, self.relocated = None, True
        if driving:
            self._moved = (
                f"the pose {jump} at once: see whether the cameras took another body for this one, "
                "turned its axes, or send another unit, or whether somebody carried the robot"
            )
        return True

    def _reaches(self, before: Frame, after: Frame) -> bool:
        passed_s = (after.utime - before.utime) / US_PER_S
        (x1, x2, theta), (y1, y2, eta) = before.pose, after.pose
        way_m, turn_rad = math.hypot(y1 - x1, y2 - x2), abs(wrap_angle(eta - theta))
        return bool(self._reach.allows(passed_s, way_m, turn_rad))

    def _note_frozen(self, frame: Frame, rolled: Velocity) -> None:
        before = self.believed
        if before is None or frame.pose != before.pose:
            self._frozen_m = self._frozen_rad = 0.0
        else:
            self._frozen_m += rolled.v
            self._frozen_rad += rolled.omega


def jump_text(before: Pose, after: Pose) -> str:
    """Return in words by how much a pose jumped."""
    way = math.hypot(after.x1 - before.x1, after.x2 - before.x2)
    turn = abs(math.degrees(wrap_angle(after.theta - before.theta)))
    return f"jumped by {way:.2f} m and {turn:.0f} deg"
