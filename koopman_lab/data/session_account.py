"""What a session recorded and what of it was used, in numbers; the verdict is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import HEARTBEATS, LOGGER_STATUS, MOCAP_POSE, WHEEL_STATE
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.believable_frames import FAULTS, Belief, Codes, believe
from koopman_lab.data.called_for_motion import CalledForMotion, InputMotion, WheelMotion
from koopman_lab.data.clock_offset import clock_offset_s
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.motion_agreement import FEWEST_WINDOWS
from koopman_lab.data.pose_tracks import reach_of
from koopman_lab.data.received_frames import ReceivedFrames, received_frames
from koopman_lab.data.segments import Run, Segment, in_time
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S

FASTER_BETWEEN_RUNS = 3.0
"""Assumption: a robot that no limits are known of is so much faster than its basis inputs."""


class JudgedFrames(NamedTuple):
    """Frames (N,) ascending in time, those invalid that cannot be believed; and what was seen.

    ``clock_offset_s`` is how much later the cameras stamp than the wheels (s), None if they agree
    or nobody knows.
    """

    frames: StructuredArray
    stream: ReceivedFrames
    belief: Belief
    by_wheels: bool
    clock_offset_s: float | None

    @property
    def left_out(self) -> dict[str, int]:
        """Return how many frames cannot be believed, by what is wrong with them."""
        return counts_by_fault(self.belief.codes)


@dataclass(frozen=True)
class Pacing:
    """Ticks of a node's timers, and those of them that were skipped as it was late."""

    ticks: int
    missed: int


@dataclass(frozen=True)
class SessionAccount:
    """Counts of a session; those of frames are of its complete runs, without what is discarded.

    Attributes
    ----------
    channel
        Name of the cameras' channel.
    stream
        How the frames of the whole session came.
    expected
        Frames that the cameras should have taken.
    received
        Frames that are stamped inside the runs, valid or not.
    invalid
        Those of them without a valid pose by their own account.
    used
        Frames in segments that are longer than the sampling time.
    left_out
        Frames that were valid and cannot be believed, by what is wrong with them.
    gaps
        Places where a run was cut into two segments.
    by_wheels
        Whether the wheels spoke.
    agreement
        How the cameras agree with wheels, or else inputs
        (:class:`~koopman_lab.data.believable_frames.Agreement`).
    clock_offset_s
        How much later the cameras stamp than the wheels (s), None if they agree or nobody knows.
    pacing
        By node, as far as heartbeats are in the log; without the logger.
    """

    channel: str
    stream: ReceivedFrames
    expected: int
    received: int
    invalid: int
    used: int
    left_out: dict[str, int]
    gaps: int
    by_wheels: bool
    agreement: dict[str, Any]
    clock_offset_s: float | None
    pacing: dict[str, Pacing]

    def as_dict(self) -> dict[str, Any]:
        """Return the account as JSON can hold it."""
        return asdict(self)


def judged_frames(log: SessionLog, config: LabConfig, runs: Sequence[Run] = ()) -> JudgedFrames:
    """Read the frames of a session and mark as invalid those that cannot show the robot.

    Parameters
    ----------
    log, config
        The session.
    runs
        Its runs under basis inputs, which say how the robot moved where no wheels do.
    """
    messages = log.array(MOCAP_POSE)
    frames = in_time(messages)
    robot = robot_type(config.robot.kind)
    poses = np.column_stack([frames["x1_m"], frames["x2_m"], frames["theta_rad"]])
    valid = frames["tracking_valid"]
    utime = frames["utime"].astype(np.int64)
    reach = reach_of(utime[valid], poses[valid], *_fastest(config, robot))
    wheels = WheelMotion(log.array(WHEEL_STATE, needed=False))
    inputs = InputMotion(runs, robot, config.processing.discard_start_s)
    sources: list[CalledForMotion] = [wheels, inputs]
    belief = believe(frames, reach, sources, runs)
    if belief.codes.any():
        frames = frames.copy()
        frames["tracking_valid"] &= belief.codes == 0
    stream = received_frames(messages, config.mocap.rate_hz)
    offset_s = None
    if belief.agreement.systematic or belief.agreement.windows < FEWEST_WINDOWS:
        offset_s = clock_offset_s(utime[valid], poses[valid, 2], wheels)
    return JudgedFrames(frames, stream, belief, len(wheels) > 0, offset_s)


def session_account(
    log: SessionLog,
    config: LabConfig,
    judged: JudgedFrames,
    runs: Sequence[Run],
    segments: Sequence[Segment],
) -> SessionAccount:
    """Count what became of the frames of a session's complete runs."""
    utime = judged.frames["utime"].astype(np.int64)
    processing, rate_hz = config.processing, config.mocap.rate_hz
    dt_us = processing.dt_s * US_PER_S
    span_us, inside = 0, np.zeros(len(utime), bool)
    codes, valid = judged.belief.codes, judged.frames["tracking_valid"]
    for run in runs:
        start_us = run.start_us + round(processing.discard_start_s * US_PER_S)
        end_us = run.end_us - round(processing.discard_end_s * US_PER_S)
        first, stop = np.searchsorted(utime, start_us), np.searchsorted(utime, end_us, "right")
        inside[first:stop] = True
        span_us += max(end_us - start_us, 0)
    return SessionAccount(
        channel=MOCAP_POSE.name(log.robot_name),
        stream=judged.stream,
        expected=round(span_us * rate_hz / US_PER_S),
        received=int(np.count_nonzero(inside)),
        invalid=int(np.count_nonzero(inside & ~valid & (codes == 0))),
        used=sum(len(s.poses) for s in segments if s.utime_us[-1] - s.utime_us[0] >= dt_us),
        left_out=counts_by_fault(codes[inside]),
        gaps=len(segments) - len({segment.run.number for segment in segments}),
        by_wheels=judged.by_wheels,
        agreement=judged.belief.agreement.as_dict(),
        clock_offset_s=judged.clock_offset_s,
        pacing=pacing(log, HEARTBEATS),
    )


def counts_by_fault(codes: Codes) -> dict[str, int]:
    """Return how many of frames (N,) have which fault."""
    counts = np.bincount(codes, minlength=len(FAULTS) + 1)[1:]
    return dict(zip(FAULTS, counts.tolist(), strict=True))


def pacing(
    log: SessionLog, heartbeats: Mapping[str, Channel[lcmtypes.node_status_t]]
) -> dict[str, Pacing]:
    """Return how each node kept time from its first heartbeat in the log to its last.

    The logger is left out: what it misses is missing from the log, and seen there.
    """
    paces = {}
    for node, channel in heartbeats.items():
        if node == LOGGER_STATUS.publisher:
            continue
        messages = log.array(channel, needed=False)
        if len(messages) > 1:
            # A process that was started again begins from 0.
            ticks, missed = (
                np.diff(messages[field].astype(np.int64)) for field in ("ticks", "missed_ticks")
            )
            paces[node] = Pacing(int(ticks[ticks > 0].sum()), int(missed[missed > 0].sum()))
    return paces


def _fastest(config: LabConfig, robot: RobotType) -> tuple[float, float]:
    """Return the speeds (m/s, rad/s) that the robot cannot exceed."""
    if robot.drive is not None:
        limits = config.motor_loop.limits
        return limits.v_m_per_s, limits.omega_rad_per_s
    dt_s = config.processing.dt_s
    rest = robot.state((0.0, 0.0, 0.0))
    moved = [robot.step(rest, np.array(u), dt_s) for u in config.sampler.basis_inputs]
    way_m = max(float(np.hypot(x[0], x[1])) for x in moved)
    turn_rad = max(abs(float(x[2])) for x in moved)
    return FASTER_BETWEEN_RUNS * way_m / dt_s, FASTER_BETWEEN_RUNS * turn_rad / dt_s
