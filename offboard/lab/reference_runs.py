"""A session of reference runs: a shape driven again and again in open loop."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, REFERENCE_STATE
from koopman_lab.bus.processes import build
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.decode import SessionLog
from offboard.desk.results import ReferenceOutcome, ReferenceSummary
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_kind import Progress, SessionKind
from offboard.lab.session_runner import run_session
from offboard.reference.node import ReferenceNode
from offboard.reference.shapes import Shape

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener

LOCKSTEP_LIMIT_S = 100_000.0
"""Virtual time after which a session that never ends is given up."""


class ReferenceRuns(SessionKind[ReferenceNode, ReferenceOutcome]):
    """Runs on one shape, which models are validated with.

    Parameters
    ----------
    shape
        Of the runs.
    """

    node_name = "reference"
    doing, unit = "driving", "runs"
    state_channel = REFERENCE_STATE
    outcome_type = ReferenceOutcome

    def __init__(self, shape: Shape) -> None:
        self.shape = shape

    def make_node(self, config: LabConfig) -> ReferenceNode:
        """Return the node that drives the runs.

        Raises
        ------
        ConfigError
            If the shape cannot be driven as configured.
        """
        node: ReferenceNode = build(self.node_name, config, self.shape)
        return node

    def outcome(self, node: ReferenceNode, missed_deadlines: int) -> ReferenceOutcome:
        """Return what the node has brought."""
        return node.outcome(missed_deadlines)

    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of `klab run reference`."""
        return "--shape", self.shape.name.lower()

    def limit_s(self, config: LabConfig) -> float:
        """Return the virtual time (s) that no session takes."""
        del config
        return LOCKSTEP_LIMIT_S

    def progress(self, node: ReferenceNode, elapsed_s: float, config: LabConfig) -> Progress:
        """Return how many runs are recorded, by the driver."""
        del config
        done, total = node.driver.done, node.driver.total
        return Progress(done, total, f"{elapsed_s:.0f} s of virtual time" if done < total else "")

    def progress_reported(
        self, state: lcmtypes.reference_state_t, elapsed_s: float, config: LabConfig
    ) -> Progress:
        """Return how many runs are recorded, by the node's message, and what a person is to do."""
        del elapsed_s, config
        note = ""
        if state.phase == state.PLACE:
            note = (
                f"place the robot at x1 {state.start_x1_m:g} m, x2 {state.start_x2_m:g} m, "
                f"theta {math.degrees(state.start_theta_rad):.0f} deg"
            )
        return Progress(state.runs_done, state.runs_total, note)

    def has_begun(self, state: lcmtypes.reference_state_t) -> bool:
        """Return whether the robot stands at the start of a run, or is on its way."""
        return state.phase not in (state.WAIT, state.PLACE)

    def waits_for(self, config: LabConfig) -> str:
        """Return what the node needs to begin."""
        name = config.robot.name
        return (
            f"{ONBOARD_STATUS.name(name)}, and for {MOCAP_POSE.name(name)} to show the robot at "
            "its start; place it there by hand, or see whether cameras and onboard loop are running"
        )


def drive_reference(
    config: LabConfig, folder: RunFolder, listener: Listener | None, shape: Shape
) -> ReferenceSummary:
    """Drive the runs and write the summary; a session that is interrupted keeps its log.

    Parameters
    ----------
    config
        The lab.
    folder
        Takes the files.
    listener
        Of this process; None for lockstep.
    shape
        Of the runs.

    Raises
    ------
    LabError
        If the session cannot be run.
    """
    run = run_session(ReferenceRuns(shape), config, folder, listener)
    log = SessionLog(folder.log)
    summary = ReferenceSummary(
        **run.outcome.model_dump(),
        lockstep=listener is None,
        duration_s=log.duration_s,
        mocap_messages_lost=log.channels[MOCAP_POSE.name(log.robot_name)].lost,
        clock_error_s=log.clock_error_s(),
    )
    folder.write_summary(config, summary.model_dump())
    return summary
