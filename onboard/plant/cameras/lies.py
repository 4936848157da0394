"""Lies of the cameras: frames that are fresh and valid, and wrong.

Each is what a frame, a body or a bridge that is set up wrongly, or a tracking that fails, makes of
what the cameras have seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.config.fault_kinds import FaultKind
from koopman_lab.config.simulation import PlannedFault
from koopman_lab.emulation.faults import Effects, Faults
from koopman_lab.geometry.planar import PlainPose, wrap_angle
from koopman_lab.units import US_PER_S
from onboard.plant.cameras.cameras import Frame

OTHER_BODY: PlainPose = (0.6, -0.4, 2.0)
"""Where another body stands that the tracking takes for the robot: assumption, on the floor."""
OTHER_NOISE: PlainPose = (0.0002, 0.0002, 0.00087)
"""How far each frame of it errs: as those of the robot with the preset `lab`."""
MM_PER_M = 1000.0


class Course(NamedTuple):
    """How far a lie has come.

    Attributes
    ----------
    since_us
        Exposure of the first frame in which it is told.
    frames
        How many frames it has been told of before this one.
    last_pose
        What was seen last before it began, None if nothing was.
    ahead_us
        How far the cameras' clock is ahead.
    """

    since_us: int
    frames: int
    last_pose: PlainPose | None
    ahead_us: int


Lie = Callable[[Frame, Course], Sequence[Frame]]
"""Returns the frames that are handed out in place of one."""


def _of_poses(change: Callable[[float, float, float], PlainPose]) -> Lie:
    """Return the lie that changes each pose; of nothing seen there is none."""

    def lie(frame: Frame, course: Course) -> Sequence[Frame]:
        del course
        utime, pose, valid = frame
        return ((utime, change(*pose), True),) if valid else (frame,)

    return lie


def _now_and_then(lasts_us: int, every_us: int, lie: Lie) -> Lie:
    """Return the lie that is told at the beginning of each period only."""

    def sometimes(frame: Frame, course: Course) -> Sequence[Frame]:
        tells = (frame[0] - course.since_us) % every_us < lasts_us
        return lie(frame, course) if tells else (frame,)

    return sometimes


def _turned(angle_rad: float) -> Callable[[float, float, float], PlainPose]:
    return lambda x1, x2, theta: (x1, x2, wrap_angle(theta + angle_rad))


def _last_pose(frame: Frame, course: Course) -> Sequence[Frame]:
    return (frame,) if course.last_pose is None else ((frame[0], course.last_pose, True),)


def _other_body(frame: Frame, course: Course) -> Sequence[Frame]:
    """Take a body that stands for the robot; its noise hangs on nothing but the time."""
    del course
    e1, e2, e3 = (np.random.default_rng(frame[0]).standard_normal(3) * OTHER_NOISE).tolist()
    x1, x2, theta = OTHER_BODY
    return ((frame[0], (x1 + e1, x2 + e2, theta + e3), True),)


_FLIPPED = _of_poses(_turned(math.pi))

LIES: dict[FaultKind, Lie] = {
    # What is seen
    "camera_slow": lambda frame, course: () if course.frames % 2 else (frame,),
    "bodies_exchanged": _now_and_then(100_000, 2 * US_PER_S, _other_body),
    "tracking_frozen": _last_pose,
    # The axes of the body
    "tracking_flipped": _now_and_then(20_000, 3 * US_PER_S, _FLIPPED),
    "heading_backwards": _FLIPPED,
    "heading_turned": _of_poses(_turned(0.5 * math.pi)),
    # The axes of the frame
    "heading_negated": _of_poses(lambda x1, x2, theta: (x1, x2, wrap_angle(-theta))),
    "axes_exchanged": _of_poses(lambda x1, x2, theta: (x2, x1, theta)),
    "frame_turned": _of_poses(lambda x1, x2, theta: (-x2, x1, theta)),
    "x2_mirrored": _of_poses(lambda x1, x2, theta: (x1, -x2, theta)),
    "frame_mirrored": _of_poses(lambda x1, x2, theta: (x1, -x2, wrap_angle(-theta))),
    # What the bridge makes of it
    "camera_unit": _of_poses(lambda x1, x2, theta: (MM_PER_M * x1, MM_PER_M * x2, theta)),
    "tracking_zero": _now_and_then(
        8_000, 5 * US_PER_S, lambda frame, _: ((frame[0], (0.0, 0.0, 0.0), True),)
    ),
    "camera_clock": lambda frame, course: ((frame[0] + course.ahead_us, *frame[1:]),),
    "frames_doubled": lambda frame, _: (frame, frame),
}
"""Each on its own, in the order in which those under way are told, one on top of the other."""


class Lies:
    """Tells those lies that are under way.

    Parameters
    ----------
    planned
        The faults that come by themselves; those of other things than the cameras do nothing.
    start_us
        Time (us) from which ``at_s`` counts.
    """

    def __init__(self, planned: Iterable[PlannedFault], start_us: int) -> None:
        self.from_us: float = -math.inf
        """What was exposed before this time (us) is handed out as it is, without asking."""
        self.last_pose: PlainPose | None = None
        """What was handed out last of what was seen; told by who does not ask."""
        self.sequence_stuck = False
        """Whether frames get no new sequence numbers, which whoever numbers them must see to."""
        self._faults = Faults(planned, start_us)
        self._courses: dict[FaultKind, Course] = {}

    def obey(self, message: lcmtypes.fault_t, now_us: int) -> None:
        """Begin the fault that a message asks for; none if the message is not allowed."""
        self._faults.obey(message, now_us)
        self.from_us = -math.inf

    def told(self, frame: Frame) -> Sequence[Frame]:
        """Return what is handed out in place of a frame; frames come in order of exposure."""
        utime, pose, valid = frame
        if utime >= self._faults.change_us:
            self._change(self._faults.at(utime), utime)
        if valid:
            self.last_pose = pose
        honest = not self._courses and not self.sequence_stuck
        self.from_us = self._faults.change_us if honest else -math.inf
        return self._lied(frame)

    def _change(self, effects: Effects, utime: int) -> None:
        self.sequence_stuck = effects.includes("sequence_stuck")
        begins = Course(utime, 0, self.last_pose, 0)
        self._courses = {
            kind: self._courses.get(kind, begins)._replace(ahead_us=effects.camera_clock_us)
            for kind in LIES
            if effects.includes(kind)
        }

    def _lied(self, frame: Frame) -> list[Frame]:
        frames = [frame]
        for kind, course in self._courses.items():
            frames = [told for seen in frames for told in LIES[kind](seen, course)]
            self._courses[kind] = course._replace(frames=course.frames + 1)
        return frames
