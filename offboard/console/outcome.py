"""What a park leaves: facts from the controller, summary, trajectory, figure."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.files import write_text
from offboard.console.folder import RunFolder
from offboard.controller.node import ControllerNode

TRAJECTORY = "trajectory.csv"

COLUMNS = (
    *("time_s", "x1_m", "x2_m", "theta_rad", "v_m_per_s", "omega_rad_per_s"),
    *("u1", "u2", "value"),
)
"""Of the trajectory's file: the state relative to the goal, the input, the value function."""


def outcome_facts(node: ControllerNode, missed_deadlines: int) -> dict[str, Any]:
    """Return how a run ended as JSON can hold it, the trajectory included."""
    outcome, points = node.outcome(), node.trajectory
    first_us = points[0].utime if points else 0
    rows = [[(p.utime - first_us) * 1e-6, *p.state, *p.u, p.value] for p in points]
    return {
        "parked": outcome.parked,
        "state": outcome.state,
        "reason": outcome.reason,
        "goal": list(outcome.goal),
        "final_pose": list(outcome.final_pose) if outcome.final_pose else None,
        "marker_offset": list(node.marker_offset),
        "duration_s": outcome.duration_s,
        "pauses": [pause._asdict() for pause in outcome.pauses],
        "solver": node.solver,
        "solve_ms": outcome.solve_ms,
        "missed_deadlines": missed_deadlines,
        "trajectory": rows,
    }


def write_park(folder: RunFolder, config: LabConfig, facts: dict[str, Any]) -> dict[str, Any]:
    """Write trajectory, figure and summary; return the summary.

    Raises
    ------
    LogError
        If the session log cannot be read.
    """
    from koopman_lab.bus.channels import MOCAP_POSE
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.figures.path import draw_path

    log, rows = SessionLog(folder.log), facts["trajectory"]
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows)
    write_text(folder.path / TRAJECTORY, table.getvalue())
    if rows:
        values = np.array(rows)
        draw_path(folder.path / "path", values[:, 0], values[:, 1:4], values[:, -1])
    solve_ms = facts["solve_ms"]
    p50, p99, largest = np.percentile(solve_ms, [50, 99, 100]).tolist() if solve_ms else [None] * 3
    summary = {
        "what": "park",
        "parked": facts["parked"],
        "state": facts["state"],
        "reason": facts["reason"],
        "final_pose": facts["final_pose"],
        "goal": facts["goal"],
        "marker_offset": facts["marker_offset"],
        "duration_s": facts["duration_s"],
        "pauses": facts["pauses"],
        "steps": len(rows),
        "solver": facts["solver"],
        "solve_ms": {"p50": p50, "p99": p99, "max": largest},
        "missed_deadlines": facts["missed_deadlines"],
        "mocap_messages_lost": log.channels[MOCAP_POSE.name(config.robot.name)].lost,
        "clock_error_s": log.clock_error_s(),
        "trajectory": TRAJECTORY,
    }
    folder.write_summary(config, summary)
    return summary
