"""What a park leaves: facts from the controller, summary, trajectory, figure."""

from __future__ import annotations

from typing import Any

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.files import write_csv
from koopman_lab.studies.closed_loop import COLUMNS
from offboard.controller.node import ControllerNode
from offboard.lab.run_folder import RunFolder

TRAJECTORY = "trajectory.csv"


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
        "solver": node.solver_description,
        "solve_ms": outcome.solve_ms,
        "pose_age_ms": outcome.pose_age_ms,
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
    from koopman_lab.figures.path import Curve, draw_paths

    log, rows = SessionLog(folder.log), facts["trajectory"]
    write_csv(folder.path / TRAJECTORY, COLUMNS, rows)
    if rows:
        values = np.array(rows)
        curve = Curve("", values[:, 0], values[:, 1:4], values[:, -1])
        draw_paths(folder.path / "path", [curve])
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
        "solve_ms": _spread(facts["solve_ms"]),
        "pose_age_ms": _spread(facts["pose_age_ms"]),
        "missed_deadlines": facts["missed_deadlines"],
        "mocap_messages_lost": log.channels[MOCAP_POSE.name(config.robot.name)].lost,
        "clock_error_s": log.clock_error_s(),
        "trajectory": TRAJECTORY,
    }
    folder.write_summary(config, summary)
    return summary


def _spread(values: list[float]) -> dict[str, float | None]:
    found = np.percentile(values, [50, 99, 100]).tolist() if values else [None] * 3
    return dict(zip(("p50", "p99", "max"), found, strict=True))
