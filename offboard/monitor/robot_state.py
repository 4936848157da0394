"""What a robot is doing, or how its newest drive ended, in words."""

from __future__ import annotations

from typing import Any

import lcmtypes
from koopman_lab.units import US_PER_S
from offboard.monitor.drives import CALIBRATION, Drive
from offboard.monitor.state_in_words import (
    ACTIVE,
    BAD,
    GONE,
    IDLE,
    REPLAY,
    WARN,
    StateInWords,
)

DOING = {CALIBRATION: "calibrating"}
"""What a drive is called while it goes on, where that is another word than what it is for."""
MINUTE_S = 60.0


def robot_state(
    now_us: int,
    *,
    gone: bool,
    replay: bool,
    status: lcmtypes.onboard_status_t | None,
    drive: Drive | None,
    waiting: str,
) -> StateInWords:
    """Return what a robot does.

    Parameters
    ----------
    now_us
        Time (us).
    gone
        Whether nobody speaks for it any more.
    replay
        Whether what is, or was, heard is a log.
    status
        What its motor loop said, None while that is silent.
    drive
        Its newest drive.
    waiting
        Why it is not driven, in words; empty if nothing forbids it.
    """
    if gone:
        if replay:
            return StateInWords("replay over", GONE)
        return StateInWords("gone", GONE, "a robot that gets no commands stops by itself")
    if replay:
        doing = "" if drive is None else _doing(drive) if drive.end is None else drive.end.word
        return StateInWords("replay", REPLAY, doing)
    if status is None:
        return StateInWords("motor loop silent", BAD, "nobody knows whether the robot stands")
    if status.state == status.ESTOP:
        return StateInWords("stopped", BAD)
    if status.state == status.FAULT:
        return StateInWords("fault", BAD)
    if drive is not None and drive.end is None:
        if waiting:
            return StateInWords("paused", WARN, waiting)
        return StateInWords(_doing(drive), ACTIVE)
    if status.state == status.WATCHDOG:
        return StateInWords("stopped by the watchdog", WARN, "commands stopped coming")
    if waiting and status.commander:
        return StateInWords("waiting", WARN, waiting)
    if status.commander:
        return StateInWords("driven", ACTIVE)
    if drive is None or drive.end is None:
        return StateInWords("idle", IDLE)
    end = drive.end
    words = end.detail, f"{age_text((now_us - drive.heard_us) / US_PER_S)} ago"
    return StateInWords(end.word, end.tone, ", ".join(filter(None, words)))


def _doing(drive: Drive) -> str:
    return DOING.get(drive.activity, drive.activity)


def age_text(age_s: float) -> str:
    """Return a time in words, as exactly as a person wants to know it."""
    if age_s < 2.0 * MINUTE_S:
        return f"{max(age_s, 0.0):.0f} s"
    minutes = age_s / MINUTE_S
    return f"{minutes:.0f} min" if minutes < 2.0 * MINUTE_S else f"{minutes / MINUTE_S:.0f} h"


def drive_times(drive: Drive | None) -> dict[str, Any] | None:
    """Return from when to when the newest drive went (s), as JSON can hold it."""
    if drive is None:
        return None
    ended_s = None if drive.end is None else drive.heard_us / US_PER_S
    return {
        "activity": drive.activity,
        "began_s": drive.began_us / US_PER_S,
        "ended_s": ended_s,
    }
