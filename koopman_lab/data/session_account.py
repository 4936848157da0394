"""What a session recorded and what of it was used, in numbers; the verdict is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import HEARTBEATS, MOCAP_POSE, WHEEL_STATE
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.believable_frames import FAULTS, Belief, believe
from koopman_lab.data.called_for_motion import CalledForMotion, InputMotion, WheelMotion
from koopman_lab.data.camera_stream import CameraStream, camera_stream
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.pose_tracks import reach_of
from koopman_lab.data.segments import Run, Segment, in_time
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S

FASTER_BETWEEN_RUNS = 3.0
"""Assumption: a robot that no limits are known of is so much faster than its basis inputs."""


class JudgedFrames(NamedTuple):
    """Frames (N,) ascending in time, those invalid that cannot be believed; and what was seen."""

    frames: StructuredArray
    stream: CameraStream
    belief: Belief
    by_wheels: bool


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
    used
        Frames in segments.
    left_out
        Frames that were valid and cannot be believed, by what is wrong with them.
    gaps
        Places where a run was cut into two segments.
    by_wheels
        Whether the wheels spoke.
    agreement
        How the cameras agree with wheels, or else inputs
        (:class:`~koopman_lab.data.believable_frames.Agreement`).
    pacing
        By node, as far as heartbeats are in the log.
    """

    channel: str
    stream: CameraStream
    expected: int
    used: int
    left_out: dict[str, int]
    gaps: int
    by_wheels: bool
    agreement: dict[str, Any]
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
    belief = believe(frames, reach, sources)
    if belief.codes.any():
        frames = frames.copy()
        frames["tracking_valid"] &= belief.codes == 0
    stream = camera_stream(messages, config.mocap.rate_hz)
    return JudgedFrames(frames, stream, belief, len(wheels) > 0)


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
    span_us, counts = 0, np.zeros(len(FAULTS) + 1, np.int64)
    for run in runs:
        start_us = run.start_us + round(processing.discard_start_s * US_PER_S)
        end_us = run.end_us - round(processing.discard_end_s * US_PER_S)
        first, stop = np.searchsorted(utime, start_us), np.searchsorted(utime, end_us, "right")
        counts += np.bincount(judged.belief.codes[first:stop], minlength=len(counts))
        span_us += max(end_us - start_us, 0)
    return SessionAccount(
        channel=MOCAP_POSE.name(log.robot_name),
        stream=judged.stream,
        expected=round(span_us * rate_hz / US_PER_S),
        used=sum(len(segment.poses) for segment in segments),
        left_out=dict(zip(FAULTS, counts[1:].tolist(), strict=True)),
        gaps=len(segments) - len({segment.run.number for segment in segments}),
        by_wheels=judged.by_wheels,
        agreement=judged.belief.agreement.as_dict(),
        pacing=pacing(log, HEARTBEATS),
    )


def pacing(
    log: SessionLog, heartbeats: Mapping[str, Channel[lcmtypes.node_status_t]]
) -> dict[str, Pacing]:
    """Return how each node kept time from its first heartbeat in the log to its last."""
    paces = {}
    for node, channel in heartbeats.items():
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
