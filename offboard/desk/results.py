"""What sessions bring: the outcome that the commanding node writes, and the summary of the run.

An outcome is what the node's process writes into its ``--result`` file and the session reads back.
A summary is ``summary.json``, without what every run folder says (robot, seed, version, revision).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from koopman_lab.evaluation.plausibility import Verdict
from koopman_lab.geometry.planar import Pose

Row = Annotated[tuple[float, ...], Field(min_length=8)]


class Result(BaseModel):
    """Base of all results: what is written cannot change, and what is read must be whole."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class CalibrationOutcome(Result):
    """What the sampler says of its session."""

    complete: bool
    """Whether all segments are recorded."""
    reason: str
    """Why the session ended before, in words; empty if it did not."""
    segments: int
    """Number of complete segments, those before a resumption included."""
    segments_wanted: int
    """Number of segments that the configuration asks for."""
    frames: int
    """Number of valid camera frames in runs, whose segment was given up or not."""
    redraws: dict[str, int]
    """Number of draws that were given up, by the reason in words."""
    missed_deadlines: int
    """Number of ticks that came too late and were skipped; 0 in lockstep."""


class ReferenceOutcome(Result):
    """What the node of reference runs says of its session."""

    shape: str
    """Name of the shape: infinity or square."""
    complete: bool
    """Whether all runs are recorded."""
    reason: str
    """Why the session ended before, in words; empty if it did not."""
    runs: int
    """Number of complete runs."""
    runs_wanted: int
    """Number of runs that the configuration asks for."""
    steps: int
    """Number of sampling times in a run."""
    repeated: dict[str, int]
    """Number of runs that were driven again, by the reason in words."""
    missed_deadlines: int
    """Number of ticks that came too late and were skipped; 0 in lockstep."""


class Pause(Result):
    """Why the robot was stopped for a while."""

    reason: str
    """In words."""
    duration_s: float
    """How long it was stopped (s)."""


class ParkEnd(Result):
    """How a parking run ended."""

    parked: bool
    """Whether the robot stood inside the parked bounds for long enough."""
    state: str
    """Name of the controller's state: WAIT, DRIVING, PARKED, TIME_LIMIT, FAILED or PAUSED."""
    reason: str
    """Why it ended so, in words."""
    final_pose: Pose | None
    """Newest valid measured pose of the robot, that which the model is of, relative to the goal
    (m, m, rad); None if there never was one."""
    goal: Pose
    """The last goal, in the inertial frame (m, m, rad)."""
    marker_offset: Pose
    """Pose of the tracked frame on the robot, as the model knows it (m, m, rad)."""
    duration_s: float
    """From the first driving step to the end of the drive (s)."""
    pauses: tuple[Pause, ...]
    """What stopped the robot for a while, in order."""
    steps: int
    """Number of driving steps, one a sampling time."""
    solver: str
    """What solved the optimal control problem, in words."""


class ParkOutcome(ParkEnd):
    """What the controller says of its run."""

    solve_ms: tuple[float, ...]
    """Wall time of each driving step (ms)."""
    pose_age_ms: tuple[float, ...]
    """Age of the newest measured pose when the command of each driving step acts (ms)."""
    missed_deadlines: int
    """Number of ticks that came too late and were skipped; 0 in lockstep."""
    trajectory: tuple[Row, ...]
    """Each driving step: time since the first one (s), the state relative to the goal (m, m, rad,
    m/s, rad/s, then what else the robot's state holds; speeds zero where it holds none), the input
    in the units of the robot's inputs, and the value function; the columns of
    ``trajectory.csv``."""


class Summary(Result):
    """How each summary begins."""

    what: str
    """Which command made the run."""


class SessionSummary(Summary):
    """How the summary of a recorded session begins."""

    lockstep: bool
    """Whether it ran on virtual time."""


# The last base comes first in the file.
class CalibrationSummary(CalibrationOutcome, SessionSummary):
    """What a calibration session brought, by its sampler and its log."""

    what: Literal["calibrate"] = "calibrate"
    """Which command made the run."""
    times_real_time: float
    """How many times faster than real time it ran; 1 in real time."""
    duration_s: float
    """From the log's first message to its last (s)."""
    samples: dict[str, int]
    """Number of state/successor pairs, by the index of the basis input."""
    clock_error_s: float | None
    """Largest error that times of the board can have (s); None if it never learned the time."""
    messages_lost: int
    """Number of messages that sequence numbers show missing, over all channels of the log."""
    verdict: Verdict
    """What is made of the session and its data, and why; an unusable session is not complete."""


class ReferenceSummary(ReferenceOutcome, SessionSummary):
    """What a session of reference runs brought, by its node and its log."""

    what: Literal["reference"] = "reference"
    """Which command made the run."""
    duration_s: float
    """From the log's first message to its last (s)."""
    mocap_messages_lost: int
    """Number of camera frames that sequence numbers show missing in the log."""
    clock_error_s: float | None
    """Largest error that times of the board can have (s); None if it never learned the time."""


class Spread(Result):
    """Of a quantity over the driving steps, in its own unit; None if there was no step."""

    p50: float | None
    """Median."""
    p99: float | None
    """99th percentile."""
    max: float | None
    """Largest value."""


class ParkSummary(ParkEnd, Summary):
    """What a parking run brought, by its controller and its log."""

    what: Literal["park"] = "park"
    """Which command made the run."""
    model: str
    """File of the model that the controller was given."""
    cost: str
    """Name of the stage cost."""
    solve_ms: Spread
    """Wall time of a driving step (ms)."""
    pose_age_ms: Spread
    """Age of the newest measured pose when the command of a driving step acts (ms)."""
    missed_deadlines: int
    """Number of ticks that came too late and were skipped; 0 in lockstep."""
    mocap_messages_lost: int
    """Number of camera frames that sequence numbers show missing in the log."""
    clock_error_s: float | None
    """Largest error that times of the board can have (s); None if it never learned the time."""
    trajectory: str
    """Name of the file with the driving steps, in the same folder."""
