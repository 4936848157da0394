"""Values of the page's snapshot as JSON can hold them: no NaN, no infinity, six digits."""

from __future__ import annotations

import math
from typing import Any

import lcmtypes
from koopman_lab.config.sampler import StateSet
from koopman_lab.config.schema import LabConfig
from offboard.monitor.headline import SAMPLER_PHASES, state_name
from offboard.monitor.process_states import ProcessState
from offboard.monitor.streams import Flow

Numbers = list[float | None]


def number(value: float | None) -> float | None:
    """Return a number as JSON can hold it, None if it is none."""
    if value is None or not math.isfinite(value):
        return None
    return float(f"{value:.6g}")


def numbers(*values: float) -> Numbers:
    """Return numbers as JSON can hold them."""
    return [number(value) for value in values]


def flow_row(flow: Flow) -> dict[str, Any]:
    """Return how a channel flows as JSON can hold it.

    Without the jitter: the page's bus is emptied only now and then.
    """
    row = flow._asdict()
    del row["jitter_s"]
    for key in ("rate_hz", "nominal_hz", "age_s"):
        row[key] = number(row[key])
    return row


def process_row(entry: ProcessState) -> dict[str, Any]:
    """Return a process as JSON can hold it."""
    row = entry._asdict()
    report = row.pop("report")
    row["age_s"] = number(entry.age_s)
    row["ended"] = "" if report is None else report.ended
    row["log_file"] = "" if report is None else report.log_file
    row["last_lines"] = "" if report is None else report.last_lines
    return row


def predicted_points(mpc: lcmtypes.mpc_state_t) -> list[Numbers]:
    """Return the predicted points (m)."""
    return [numbers(*p) for p in zip(mpc.predicted_x1_m, mpc.predicted_x2_m, strict=True)]


def sampler_progress(state: lcmtypes.sampler_state_t) -> dict[str, Any]:
    """Return how far a calibration session is."""
    return {
        "phase": state_name(SAMPLER_PHASES, state.phase),
        "done": state.segments_done,
        "total": state.segments_total,
        "samples": state.samples,
        "redraws": state.redraws,
    }


def floor_box(states: StateSet) -> dict[str, list[float]]:
    """Return a set as it lies on the floor (m)."""
    return {"x1_m": list(states.x1_m), "x2_m": list(states.x2_m)}


def config_facts(config: LabConfig) -> dict[str, Any]:
    """Return what the page shows of a robot's configuration, the same from message to message."""
    return {
        "kind": config.robot.kind,
        "interval_ms": number(config.controller.dt_s * 1e3),
        "robot": config.robot.model_dump(mode="json"),
        "floor": config.floor.model_dump(mode="json"),
        "sets": {
            "X0": floor_box(config.sampler.draw_set),
            "Z": floor_box(config.sampler.admissible_set),
        },
    }
