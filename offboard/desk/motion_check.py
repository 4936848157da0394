"""Whether cameras, wheels and commands tell of one and the same motion.

Over a sliding window the motion that the cameras see is held against that of the wheels, in the
robot's own frame: forward, sideways and turned. So it does not matter where the inertial frame
lies. Signs and sizes are judged with tolerances that no slip, lag, noise or marker offset reaches;
what is beyond them is wired, glued or configured wrongly.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from koopman_lab.bus.age import is_current
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import REST, Velocity, wrap_angle
from koopman_lab.units import US_PER_S
from offboard.desk.interlock import Cause, Interlock
from offboard.desk.measurements import Frame, WheelSpeeds
from offboard.desk.motion_track import Motion, MotionTrack

WINDOW_US, SHORTEST_US = 800_000, 400_000
"""How far is looked back: so far, and at the beginning of a drive at least so far."""
PERSISTS_US = 100_000
"""A contradiction stops the robot once it lasts so long."""
FORWARD_SHARE, SIDEWAYS_SHARE, TURN_SHARE = 0.5, 0.35, 0.5
"""Of the way, or the turn: `harsh` slips by 0.1 of it sideways, and its wheels are 3 % wrong."""
FORWARD_M, SIDEWAYS_M, TURN_RAD = 0.02, 0.015, 0.15
"""On top: noise, and wheels whose stamps are off until the board knows the time."""
STANDS_M, STANDS_RAD, STANDS_SHARE = 0.01, 0.05, 0.05
"""Who moves no more than noise, or than a small share of what the other source says, stands."""
LEVER = 0.35
"""Nobody tracks a point farther from the axle's middle, as a share of the track width."""
MARKER_M = 0.02
"""How far a tracked frame can be off whose offset was taken out."""
COMMANDED_US = 2_000_000
"""Speeds that were commanded within so long may still be seen; cautious gains lag by a second."""
COMMANDED_SHARE, COMMANDED_M_PER_S, COMMANDED_RAD_PER_S = 0.5, 0.08, 0.4
"""How much faster than commanded a wheel may be, as a share and on top."""
FOLLOWS_SHARE = 0.1
"""Who moves less than that of what was commanded all the time does not follow."""


class Commanded(NamedTuple):
    """A set-point of the motor loop, as it was heard at a time (us)."""

    heard_us: int
    velocity: Velocity


class MotionCheck:
    """Compares three sources of motion.

    Parameters
    ----------
    config
        The robot's geometry.
    lever_m
        How far the tracked point may be from the axle's middle (m): turning moves it so much; None
        where nobody knows.
    """

    def __init__(self, config: LabConfig, lever_m: float | None = None) -> None:
        self._lever_m = LEVER * config.robot.track_width_m if lever_m is None else lever_m
        self._seen, self._rolled = MotionTrack(), MotionTrack()
        self._commanded: deque[Commanded] = deque()
        self._frame: Frame | None = None
        self._wheels: WheelSpeeds | None = None
        self._driving_since_us: int | None = None
        self._doubted_since_us: int | None = None
        self._found = ""

    def see_frame(self, frame: Frame) -> None:
        """Take a frame that can be believed; later than those before."""
        before, self._frame = self._frame, frame
        if before is None:
            self._seen.add(frame.utime, 0.0, 0.0, 0.0)
            return
        (x1, x2, theta), (y1, y2, eta) = before.pose, frame.pose
        turned = wrap_angle(eta - theta)
        half_way = theta + 0.5 * turned
        c, s, dx, dy = math.cos(half_way), math.sin(half_way), y1 - x1, y2 - x2
        self._seen.add(frame.utime, c * dx + s * dy, c * dy - s * dx, turned)

    def see_wheels(self, wheels: WheelSpeeds) -> Velocity:
        """Take wheel odometry; return what has been rolled and turned since the last (m, rad)."""
        before, self._wheels = self._wheels, wheels
        if before is None:
            before = wheels
        passed_s = (wheels.utime - before.utime) / US_PER_S
        forward = 0.5 * (before.velocity.v + wheels.velocity.v) * passed_s
        turned = 0.5 * (before.velocity.omega + wheels.velocity.omega) * passed_s
        self._rolled.add(wheels.utime, forward, 0.0, turned)
        if not 0.0 < passed_s < 1.0:
            return REST
        return Velocity(abs(forward), abs(turned))

    def see_setpoint(self, setpoint: Velocity, now_us: int) -> None:
        """Take the set-point that the motor loop says."""
        self._commanded.append(Commanded(now_us, setpoint))
        while self._commanded[0].heard_us < now_us - COMMANDED_US:
            self._commanded.popleft()

    def interlock(self, now_us: int, *, driving: bool) -> Interlock | None:
        """Return the contradiction that was found while driving, None if there is none."""
        if not driving:
            self._driving_since_us = self._doubted_since_us = None
        elif self._driving_since_us is None:
            self._driving_since_us = now_us
        elif not self._found:
            self._judge(now_us, self._driving_since_us)
        if not self._found:
            return None
        return Interlock(self._found, lasting=True, cause=Cause.MOTION)

    def restart(self) -> None:
        """Forget all: the robot is somewhere else."""
        self._seen.clear()
        self._rolled.clear()
        self._commanded.clear()
        self._frame = self._wheels = None
        self._driving_since_us = self._doubted_since_us = None
        self._found = ""

    def _judge(self, now_us: int, since_us: int) -> None:
        doubt = self._cameras_against_wheels(since_us) or self._motion_against_commands(
            now_us, since_us
        )
        if not doubt:
            self._doubted_since_us = None
        elif self._doubted_since_us is None:
            self._doubted_since_us = now_us
        elif now_us - self._doubted_since_us >= PERSISTS_US:
            self._found = doubt

    def _cameras_against_wheels(self, since_us: int) -> str:
        seen, rolled = self._seen.span_us, self._rolled.span_us
        if seen is None or rolled is None:
            return ""
        end_us = min(seen[1], rolled[1])
        start_us = max(seen[0], rolled[0], since_us, end_us - WINDOW_US)
        if end_us - start_us < SHORTEST_US:
            return ""
        return contradiction(
            self._seen.between(start_us, end_us),
            self._rolled.between(start_us, end_us),
            self._lever_m,
        )

    def _motion_against_commands(self, now_us: int, since_us: int) -> str:
        """Judge the motion of the wheels, or what the cameras see of it while no wheels speak."""
        commanded = self._commanded
        who, track, lever_m = WHEELS, self._rolled, 0.0
        if track.span_us is None or not is_current(track.span_us[1], now_us, WINDOW_US):
            who, track, lever_m = SEEN_ROBOT, self._seen, self._lever_m
        span = track.span_us
        if span is None or not is_current(span[1], now_us, WINDOW_US) or not commanded:
            return ""
        start_us = max(span[0], since_us, span[1] - WINDOW_US)
        if span[1] - start_us < SHORTEST_US:
            return ""
        motion, passed_s = track.between(start_us, span[1]), (span[1] - start_us) / US_PER_S
        whole = now_us - commanded[0].heard_us > 0.9 * COMMANDED_US and since_us < (
            now_us - COMMANDED_US
        )
        v = [c.velocity.v for c in commanded]
        omega = [c.velocity.omega for c in commanded]
        # A point beside the axle's middle moves while the robot turns on the spot.
        slack_m_per_s = COMMANDED_M_PER_S + lever_m * max(map(abs, omega))
        return _disobedience(
            who, "roll", "m/s", motion.forward_m / passed_s, v, slack_m_per_s, whole=whole
        ) or _disobedience(
            *(who, "turn", "rad/s", motion.turned_rad / passed_s, omega, COMMANDED_RAD_PER_S),
            whole=whole,
        )


def contradiction(seen: Motion, rolled: Motion, lever_m: float) -> str:
    """Return in words how the motion seen by cameras contradicts that of the wheels.

    Empty if it does not.

    Parameters
    ----------
    seen, rolled
        Motion over the same time, by cameras and by wheels.
    lever_m
        How far the tracked point may be from the axle's middle (m).
    """
    path_m = max(seen.path_m, rolled.path_m)
    swept_rad = max(seen.swept_rad, rolled.swept_rad)
    arc_m = lever_m * swept_rad
    turn_off = abs(seen.turned_rad - rolled.turned_rad) > TURN_RAD + TURN_SHARE * swept_rad
    forward_off = (
        abs(seen.forward_m - rolled.forward_m) > FORWARD_M + FORWARD_SHARE * path_m + arc_m
    )
    sideways_off = abs(seen.sideways_m) > SIDEWAYS_M + SIDEWAYS_SHARE * path_m + arc_m
    if not (turn_off or forward_off or sideways_off):
        return ""
    turn_reversed = turn_off and _opposite(seen.turned_rad, rolled.turned_rad)
    forward_reversed = forward_off and _opposite(seen.forward_m, rolled.forward_m)
    if not sideways_off and _stands(seen, rolled):
        causes = STANDING_CAUSES
    elif _stands(rolled, seen):
        causes = PUSHED_CAUSES
    elif sideways_off:
        causes = SIDEWAYS_CAUSES
    elif turn_reversed and forward_reversed:
        causes = BOTH_REVERSED_CAUSES
    elif turn_reversed:
        causes = TURN_REVERSED_CAUSES
    elif forward_reversed:
        causes = FORWARD_REVERSED_CAUSES
    else:
        causes = SIZE_CAUSES
    return f"cameras and wheels disagree ({_text(seen)} against {_text(rolled)}); check {causes}"


SIDEWAYS_CAUSES = (
    "the axes of the cameras' frame (x1 and x2 exchanged, or turned), its handedness, the "
    "orientation of the rigid body, then whether another body is tracked"
)
BOTH_REVERSED_CAUSES = (
    "the axes of the cameras' frame, its handedness (angles clockwise), then whether motors and "
    "encoders of both wheels are reversed"
)
TURN_REVERSED_CAUSES = (
    "the handedness of the cameras' frame (an axis mirrored, angles clockwise), then whether left "
    "and right wheel are exchanged, or both are reversed"
)
FORWARD_REVERSED_CAUSES = (
    "the orientation of the rigid body (its forward axis points backwards), then whether left and "
    "right wheel are exchanged and reversed, or both are reversed"
)
SIZE_CAUSES = (
    "the units of the cameras' frame (m, rad), robot.wheel_radius_m, robot.track_width_m and "
    "motor_loop.encoder_counts_per_rev, then whether another body is tracked"
)
STANDING_CAUSES = (
    "whether the tracking is frozen, whether another body is tracked, then whether the wheels "
    "touch the floor"
)
PUSHED_CAUSES = (
    "whether the encoders count, whether another body is tracked, then whether somebody pushes the "
    "robot"
)


def _opposite(a: float, b: float) -> bool:
    return a * b < 0.0 and abs(a) > 0.3 * abs(b)


def _stands(one: Motion, other: Motion) -> bool:
    """Return whether one source tells of next to no motion beside the other."""
    return abs(one.forward_m) <= STANDS_M + STANDS_SHARE * other.path_m and (
        abs(one.turned_rad) <= STANDS_RAD + STANDS_SHARE * other.swept_rad
    )


def _text(motion: Motion) -> str:
    sideways = f"{abs(motion.sideways_m) * 1e2:.0f} cm sideways, " if motion.sideways_m else ""
    return (
        f"{motion.forward_m * 1e2:.0f} cm forward, {sideways}"
        f"{math.degrees(motion.turned_rad):.0f} deg"
    )


def _disobedience(
    who: Source,
    verb: str,
    unit: str,
    mean: float,
    setpoints: list[float],
    extra: float,
    *,
    whole: bool,
) -> str:
    """Return in words how a mean speed contradicts all set-points of late; empty if it does not."""
    low, high = min(setpoints), max(setpoints)
    slack = extra + COMMANDED_SHARE * max(abs(low), abs(high))
    said = f"{who.name} {verb} at {mean:.2f} {unit}, commanded were {low:.2f} to {high:.2f}; check "
    if not min(low, 0.0) - slack <= mean <= max(high, 0.0) + slack:
        return f"{said}{who.wrong}"
    least = low if low > 0.0 else -high if high < 0.0 else 0.0
    if whole and least > extra and abs(mean) < FOLLOWS_SHARE * least:
        return f"{said}{who.still}"
    return ""


class Source(NamedTuple):
    """What tells of motion, and what to check if it tells of another or of none."""

    name: str
    wrong: str
    still: str


WHEELS = Source(
    "the wheels",
    "whether motors or encoders are exchanged or reversed, then motor_loop.encoder_counts_per_rev",
    "whether the motors have power and the encoders count",
)
SEEN_ROBOT = Source(
    "as the cameras see it, and no wheels speak, the robot",
    "the axes of the cameras' frame, its handedness, the orientation of the rigid body, then "
    "whether wheels are exchanged or reversed",
    "whether the motors have power, and whether another body is tracked",
)
