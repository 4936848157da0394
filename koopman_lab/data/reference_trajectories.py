"""Reference runs in the log of a session: states along the way, and the inputs that led it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, REFERENCE_STATE
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.collect import check_frames
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.marker import without_offset
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.processing import margin, states
from koopman_lab.data.segments import Run, cut, in_time
from koopman_lab.data.session_account import judged_frames
from koopman_lab.errors import DataError
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S

LATE = 1.1
"""A command that comes later, in control intervals, was not there in time."""
NO_BASIS = -1
"""Stands for the index of a basis input where there is none."""
SHAPES = {
    lcmtypes.reference_state_t.INFINITY: "infinity",
    lcmtypes.reference_state_t.SQUARE: "square",
}


class Trajectory(NamedTuple):
    """What was measured and commanded in one reference run.

    Attributes
    ----------
    number
        Counts the runs of the log.
    start_us, end_us
        From the first input to the end of the last (us).
    utime_us
        Times of the states (k,) in us, ascending; where frames were lost, states are missing.
    x
        States (k, n) in the units of the robot's states.
    command_us
        Times of the inputs (c,) in us; each is held until the next.
    inputs
        Inputs (c, m) as logged. A robot with drift obeys a command for no longer than its control
        interval: where the next one came late, zero stands in between.
    """

    number: int
    start_us: int
    end_us: int
    utime_us: NDArray[np.int64]
    x: NDArray[np.float64]
    command_us: NDArray[np.int64]
    inputs: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReferenceRuns:
    """The complete runs of a session.

    Attributes
    ----------
    path
        The log.
    config
        Configuration of the lab that recorded it.
    shape
        Name of the shape.
    window
        Length of the smoothing window (frames).
    count
        Number of runs.
    start
        Nominal state at the start (n,), at rest.
    trajectories
        Gives the runs in order of time, as seen by a model with this marker offset: the pose of
        the tracked frame in the frame whose poses the model is of.
    left_out
        Frames of the log that cannot show the robot and are in no trajectory, by what is wrong
        with them (:mod:`koopman_lab.data.believable_frames`).
    """

    path: Path
    config: LabConfig
    shape: str
    window: int
    count: int
    start: NDArray[np.float64]
    trajectories: Callable[[Pose], list[Trajectory]]
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def robot(self) -> RobotType:
        """Return the robot that drove."""
        return robot_type(self.config.robot.kind)


def reference_runs(log: SessionLog, window: int | None = None) -> ReferenceRuns:
    """Read the complete runs of a session that `klab reference` recorded.

    Velocities are differences of the poses, smoothed over a whole run together with the stands
    before and after it; a run's inputs change in each step, so there is nothing to keep apart.

    Parameters
    ----------
    log
        The session.
    window
        In place of ``processing.smoothing_window``.

    Raises
    ------
    LogError
        If the log cannot be used or does not say its configuration.
    DataError
        If it holds no complete reference run, or runs of several shapes.
    """
    messages = in_time(log.array(REFERENCE_STATE))
    where = f"{log.path}, {REFERENCE_STATE.name(log.robot_name)}"
    driven = [run for run in _driven(messages) if len(run)]
    if not driven:
        raise DataError(
            f"{where}: no complete reference run; give the folder or log of a session that "
            "`klab reference` recorded"
        )
    shapes = {int(run["shape"][0]) for run in driven}
    if len(shapes) > 1:
        raise DataError(f"{where}: runs of several shapes; record one session to a log")
    config = log.config()
    window = config.processing.smoothing_window if window is None else window
    judged, rate_hz = judged_frames(log, config), config.mocap.rate_hz
    frames = judged.frames
    check_frames(f"{log.path}, {MOCAP_POSE.name(log.robot_name)}", frames["utime"], rate_hz)
    first = driven[0][0]
    start = np.zeros(robot_type(config.robot.kind).state_dim)
    start[:3] = first["start_x1_m"], first["start_x2_m"], first["start_theta_rad"]

    def trajectories(offset: Pose) -> list[Trajectory]:
        return [
            _trajectory(number, run, frames, config, window, offset)
            for number, run in enumerate(driven)
        ]

    return ReferenceRuns(
        log.path,
        config,
        SHAPES[shapes.pop()],
        window,
        len(driven),
        start,
        trajectories,
        judged.left_out,
    )


def _driven(messages: StructuredArray) -> list[StructuredArray]:
    """Return the states of each run that drove all of its inputs and lost none on the way here."""
    messages = messages[messages["phase"] == lcmtypes.reference_state_t.RUN]
    runs = [messages[messages["run"] == number] for number in np.unique(messages["run"])]
    return [r for r in runs if np.array_equal(r["step"], np.arange(r["steps"][0]))]


def _trajectory(
    number: int,
    driven: StructuredArray,
    frames: StructuredArray,
    config: LabConfig,
    window: int,
    offset: Pose,
) -> Trajectory:
    interval_us, robot = round(config.controller.dt_s * US_PER_S), robot_type(config.robot.kind)
    command_us, inputs = _held_inputs(driven, interval_us, robot)
    start_us, end_us = int(driven["utime"][0]), int(driven["utime"][-1]) + interval_us
    rate_hz = config.mocap.rate_hz
    # The robot stands before and after, so that the first and the last state have whole windows.
    around_us = round((margin(window) + 2) / rate_hz * US_PER_S)
    run = Run(number, NO_BASIS, (), start_us - around_us, end_us + around_us)
    segments = cut([run], frames, frame_rate_hz=rate_hz)
    if offset != ORIGIN:
        segments = [s._replace(poses=without_offset(s.poses, offset)) for s in segments]
    pieces = [states(segment, robot, window) for segment in segments]
    return Trajectory(
        number,
        start_us,
        end_us,
        np.concatenate([np.zeros(0, np.int64), *(piece.utime_us for piece in pieces)]),
        np.concatenate([np.zeros((0, robot.state_dim)), *(piece.x for piece in pieces)]),
        command_us,
        inputs,
    )


def _held_inputs(
    driven: StructuredArray, interval_us: int, robot: RobotType
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return times (c,) and inputs (c, m), each in effect until the next."""
    command_us = driven["utime"].astype(np.int64)
    inputs = driven["u"][:, : robot.input_dim]
    if not robot.drifts:
        return command_us, inputs
    late = np.flatnonzero(np.diff(command_us) > LATE * interval_us)
    ends_us = command_us[late] + interval_us
    return np.insert(command_us, late + 1, ends_us), np.insert(inputs, late + 1, 0.0, axis=0)


def mean_inputs(
    trajectory: Trajectory, since_us: NDArray[np.float64], dt_us: float
) -> NDArray[np.float64]:
    """Return the means (..., m) of the held inputs over intervals of ``dt_us``.

    ``since_us`` (...) in us are their beginnings, counted from the start of the run. The mean of
    an interval that begins with a command is the command. Outside the run inputs are zero.
    """
    edges = np.append(trajectory.command_us, trajectory.end_us) - trajectory.start_us
    steps = np.diff(edges)[:, None] * trajectory.inputs
    integral = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])

    def up_to(times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.interp(times, edges, column) for column in integral.T], axis=-1)

    means: NDArray[np.float64] = (up_to(since_us + dt_us) - up_to(since_us)) / dt_us
    return means
