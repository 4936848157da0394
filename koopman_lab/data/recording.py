"""What a session recorded: its configuration, its runs, and their segments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from koopman_lab.bus.channels import MOCAP_POSE, REFERENCE_STATE, SAMPLER_STATE
from koopman_lab.config.schema import LabConfig, Processing
from koopman_lab.data.collect import check_frames, check_runs
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.marker import MarkerOffset, find_marker, without_offset
from koopman_lab.data.segments import Run, Segment, basis_runs, completed, cut
from koopman_lab.data.session_account import SessionAccount, judged_frames, session_account
from koopman_lab.errors import DataError


@dataclass(frozen=True, eq=False)
class Recording:
    """A calibration session as data sets and figures need it.

    Attributes
    ----------
    path
        The log.
    config
        Configuration of the lab that recorded it.
    robot_name
        Name of the robot.
    settings
        How it is processed.
    marker
        Where on the robot the tracked frame is.
    runs
        Complete runs, in order of time.
    given_up
        Number of runs that are not complete.
    segments
        Segments of the complete runs, in order of time; the poses are the robot's if
        ``settings.remove_marker_offset`` says so and the marker offset is known, and those of the
        tracked frame otherwise. Frames that cannot show the robot are in none
        (:mod:`koopman_lab.data.believable_frames`).
    account
        What was recorded and used, in numbers.
    """

    path: Path
    config: LabConfig
    robot_name: str
    settings: Processing
    marker: MarkerOffset
    runs: list[Run]
    given_up: int
    segments: list[Segment]
    account: SessionAccount

    def segments_of(self, basis_index: int) -> list[Segment]:
        """Return the segments under one basis input."""
        return [s for s in self.segments if s.run.basis_index == basis_index]


def recording(
    log: SessionLog,
    config: LabConfig | None = None,
    *,
    dt_s: float | None = None,
    window: int | None = None,
) -> Recording:
    """Cut a session into segments.

    Parameters
    ----------
    log
        The session.
    config
        In place of the configuration that the log says.
    dt_s, window
        In place of ``processing.dt_s`` and ``processing.smoothing_window``.

    Raises
    ------
    LogError
        If the log cannot be used or does not say its configuration.
    ConfigError
        If the configuration in the log is not valid.
    DataError
        If the log holds no complete run of a basis input or is of another configuration.
    """
    config = log.config() if config is None else config
    settings = _settings(config.processing, dt_s, window)
    states = log.array(SAMPLER_STATE)
    runs = basis_runs(states)
    rate_hz, inputs = config.mocap.rate_hz, config.sampler.indexed_inputs
    if not runs and len(log.array(REFERENCE_STATE, needed=False)):
        raise DataError(
            f"{log.path}: holds reference runs, which are for `klab validate` and never trained "
            "with; give the log of a session that `klab calibrate` recorded"
        )
    complete = completed(runs, states)
    check_runs(f"{log.path}, {SAMPLER_STATE.name(log.robot_name)}", complete, inputs)
    judged = judged_frames(log, config, complete)
    frames = judged.frames
    check_frames(f"{log.path}, {MOCAP_POSE.name(log.robot_name)}", frames["utime"], rate_hz)
    segments = cut(
        complete,
        frames,
        frame_rate_hz=rate_hz,
        discard_start_s=settings.discard_start_s,
        discard_end_s=settings.discard_end_s,
    )
    account = session_account(
        log, config.model_copy(update={"processing": settings}), judged, complete, segments
    )
    marker = find_marker(states, frames, rate_hz)
    if settings.remove_marker_offset and marker.offset is not None:
        offset = marker.offset
        segments = [s._replace(poses=without_offset(s.poses, offset)) for s in segments]
    given_up = len(runs) - len(complete)
    return Recording(
        log.path, config, log.robot_name, settings, marker, complete, given_up, segments, account
    )


def _settings(processing: Processing, dt_s: float | None, window: int | None) -> Processing:
    dt_s = processing.dt_s if dt_s is None else dt_s
    window = processing.smoothing_window if window is None else window
    if not (0.0 < dt_s < float("inf") and window >= 1):
        raise DataError(f"dt {dt_s} s, window {window}: dt must be above 0, the window at least 1")
    return processing.model_copy(update={"dt_s": dt_s, "smoothing_window": window})
