"""A calibration session: the sampler lets the robot answer a few constant inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, SAMPLER_STATE, split_name
from koopman_lab.bus.processes import build
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import LabError
from koopman_lab.evaluation.data_verdict import excitations
from koopman_lab.evaluation.plausibility import Reason, Verdict, together, verdict
from koopman_lab.evaluation.session_verdict import recorded_verdicts
from koopman_lab.koopman.dictionary import dictionary
from offboard.desk.floor import require_sets_on_floor
from offboard.desk.results import CalibrationOutcome, CalibrationSummary
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_kind import Progress, SessionKind
from offboard.lab.session_runner import run_session
from offboard.sampler.node import SamplerNode
from offboard.sampler.redraws import redraws_text
from offboard.sampler.resume import Interrupted, interrupted

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener

LOCKSTEP_LIMIT_S = 100_000.0
"""Virtual time after which a session that never ends is given up."""


class Calibration(SessionKind[SamplerNode, CalibrationOutcome]):
    """A calibration session (paper, section 5.1).

    Parameters
    ----------
    resumed
        Folder of an interrupted session that goes on; None to begin one.

    Raises
    ------
    LogError
        If there is no log in that folder, or it cannot be used.
    LabStateError
        If there is nothing to go on with, or nothing left to do.
    """

    node_name = "sampler"
    doing, unit = "calibrating", "segments"
    state_channel = SAMPLER_STATE
    outcome_type = CalibrationOutcome

    def __init__(self, resumed: RunFolder | None = None) -> None:
        self.resumed = resumed
        self.before: Interrupted | None = interrupted(resumed.path) if resumed else None
        """What the interrupted session has brought."""
        self.resume_us = self.before.next_us if self.before else None

    def make_node(self, config: LabConfig) -> SamplerNode:
        """Return the sampler."""
        before = self.before.progress if self.before else None
        node: SamplerNode = build(self.node_name, config, before)
        return node

    def outcome(self, node: SamplerNode, missed_deadlines: int) -> CalibrationOutcome:
        """Return what the sampler has brought."""
        return node.outcome(missed_deadlines)

    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of `klab run sampler`."""
        return ("--resume", str(self.resumed.path)) if self.resumed else ()

    def limit_s(self, config: LabConfig) -> float:
        """Return the virtual time (s) that no session takes."""
        del config
        return LOCKSTEP_LIMIT_S

    def progress(self, node: SamplerNode, elapsed_s: float, config: LabConfig) -> Progress:
        """Return how many segments are recorded, by the sampler."""
        del config
        sampler, waits_for = node.sampler, node.sampler.waits_for
        notes = (
            f"{sampler.frames} samples, {elapsed_s:.0f} s of virtual time",
            redraws_text(sampler.redraws.numbers()),
            "" if waits_for is None else f"waits: {waits_for.reason}",
        )
        return Progress(sampler.done, sampler.total, "; ".join(filter(None, notes)))

    def progress_reported(
        self, state: lcmtypes.sampler_state_t, elapsed_s: float, config: LabConfig
    ) -> Progress:
        """Return how many segments are recorded, by the sampler's message."""
        del elapsed_s, config
        notes = f"{state.samples} samples", redraws_text(state.redraws_by_reason)
        return Progress(state.segments_done, state.segments_total, "; ".join(filter(None, notes)))

    def has_begun(self, state: lcmtypes.sampler_state_t) -> bool:
        """Return whether the sampler drives."""
        return state.phase != state.WAIT

    def waits_for(self, config: LabConfig) -> str:
        """Return what the sampler needs to begin."""
        name = config.robot.name
        return (
            f"{MOCAP_POSE.name(name)} and {ONBOARD_STATUS.name(name)}; are the cameras and the "
            "onboard loop running?"
        )

    def after_interruption(self, folder: RunFolder, *, lockstep: bool) -> str:
        """Return the command that goes on with the session."""
        mode = " --lockstep" if lockstep else ""
        return f"`klab calibrate --resume {folder.path}{mode}` goes on with the session"


def calibrate(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener | None,
    session: Calibration | None = None,
) -> CalibrationSummary:
    """Run the session and write its summary; a session that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    listener
        Of this process; None for lockstep.
    session
        The session in the folder that is to go on; None to begin one.

    Raises
    ------
    LabError
        If the session cannot be run.
    """
    require_sets_on_floor(config)
    session = session or Calibration()
    run = run_session(session, config, folder, listener)
    log = SessionLog(folder.log, salvage=session.before is not None)
    samples, judged = _judged(log, run.outcome.segments)
    summary = CalibrationSummary(
        **run.outcome.model_dump() | {"complete": run.outcome.complete and judged.usable},
        lockstep=listener is None,
        times_real_time=run.times_real_time,
        duration_s=log.duration_s,
        samples=samples,
        clock_error_s=log.clock_error_s(),
        messages_lost=sum(
            # Beside the logger of `klab up` two number these channels, each on its own.
            channel.lost
            for name, channel in log.channels.items()
            if split_name(name)[1].publisher != "logger"
        ),
        verdict=judged,
    )
    folder.write_summary(config, summary.model_dump())
    return summary


def _judged(log: SessionLog, segments: int) -> tuple[dict[str, int], Verdict]:
    """Return the number of pairs by basis input, and the verdict on the session and its data.

    Of a session that gave no data there are none; what hindered it is the reason.
    """
    if not segments:
        return {}, verdict([Reason("unusable", "no segment was completed")], {})
    try:
        dataset = DataSet.from_log(log)
        observables = dictionary(log.config().model.dictionary, dataset.robot_kind)
        parts = recorded_verdicts(dataset, excitations(dataset, observables), observables)
    except LabError as error:
        return {}, verdict([Reason("unusable", str(error))], {})
    return {str(index): len(x) for index, x in dataset.X.items()}, together(**parts)
