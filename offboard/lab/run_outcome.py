"""How a run ended, in words, by the ``summary.json`` that it left."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from offboard.monitor.state_in_words import GOOD, IDLE, WARN, StateInWords


def outcome_of(summary: Mapping[str, Any]) -> StateInWords:
    """Return how a run ended.

    Parameters
    ----------
    summary
        As read; of another version, or of a run of another kind, it may lack anything.
    """
    what = summary.get("what")
    if what == "park":
        return _of_park(summary)
    if what == "calibrate":
        return _of_session(
            summary, "calibrated", "not calibrated", f"{_count(summary, 'segments')} segments"
        )
    if what == "reference":
        return _of_session(
            summary, "runs recorded", "not all runs", f"{_count(summary, 'runs')} runs"
        )
    if what == "demo" and isinstance(summary.get("passed"), bool):
        passed = summary["passed"]
        return StateInWords("parked" if passed else "not parked", GOOD if passed else WARN)
    return StateInWords("done", IDLE)


def _of_park(summary: Mapping[str, Any]) -> StateInWords:
    where = _deviation_text(summary.get("final_pose"))
    duration = summary.get("duration_s")
    after = f"after {duration:.1f} s" if isinstance(duration, int | float) else ""
    if summary.get("parked") is True:
        return StateInWords("parked", GOOD, _joined(where, after))
    return StateInWords("not parked", WARN, _joined(str(summary.get("reason", "")), where, after))


def _of_session(summary: Mapping[str, Any], good: str, bad: str, recorded: str) -> StateInWords:
    verdict = summary.get("verdict")
    judged = f"data {verdict['level']}" if isinstance(verdict, dict) and "level" in verdict else ""
    reason = str(summary.get("reason", ""))
    if summary.get("complete") is True:
        return StateInWords(good, GOOD, _joined(recorded, judged))
    return StateInWords(bad, WARN, _joined(reason, recorded, judged))


def _count(summary: Mapping[str, Any], key: str) -> str:
    return f"{summary.get(key, '?')} of {summary.get(f'{key}_wanted', '?')}"


def _deviation_text(pose: Any) -> str:
    """Return in words how far a pose (m, m, rad) is from the goal; empty for none."""
    if not isinstance(pose, list | tuple) or len(pose) != 3:
        return ""
    if not all(isinstance(value, int | float) and math.isfinite(value) for value in pose):
        return ""
    x1, x2, theta = pose
    return f"{math.hypot(x1, x2) * 1e3:.1f} mm and {abs(math.degrees(theta)):.1f}° from the goal"


def _joined(*parts: str) -> str:
    return ", ".join(filter(None, parts))
