"""The newest drive of a robot: what it was for, when it began, and how it ended."""

from __future__ import annotations

import math
from typing import NamedTuple

import lcmtypes
from koopman_lab.units import US_PER_S
from offboard.monitor.state_in_words import GOOD, WARN, StateInWords

PARKING, CALIBRATION, REFERENCE = "parking", "calibration", "reference runs"
SILENT_S = 2.0
"""Whoever drives speaks at each sampling time; one who is silent for so long has ended."""


class Drive(NamedTuple):
    """One drive.

    Attributes
    ----------
    activity
        What it is for: one of the constants.
    began_us
        When its first command was heard of (us).
    heard_us
        When it was heard of last (us).
    end
        How it ended, at ``heard_us``; None while it goes on. Its tone is ``good``, or ``warn``
        where the drive did not do what it was for.
    """

    activity: str
    began_us: int
    heard_us: int
    end: StateInWords | None = None


class Drives:
    """Messages of those who drive in, the newest drive out."""

    def __init__(self) -> None:
        self._drive: Drive | None = None
        self._deviation = ""

    def newest(self, now_us: int) -> Drive | None:
        """Return the newest drive; one of which nobody speaks any more was broken off."""
        drive = self._drive
        if drive is None or drive.end is not None or not _silent(drive, now_us):
            return drive
        who = {PARKING: "controller", CALIBRATION: "sampler"}.get(drive.activity, "reference node")
        detail = f"the {who} fell silent before the end"
        word = "not parked" if drive.activity == PARKING else f"{drive.activity} broken off"
        return drive._replace(end=StateInWords(word, WARN, detail))

    def take_mpc(self, state: lcmtypes.mpc_state_t, now_us: int, reason: str = "") -> None:
        """Take a step of the controller.

        Parameters
        ----------
        state
            The step.
        now_us
            When it arrived (us).
        reason
            Why the robot is not driven, as the controller said last; empty if it did not.
        """
        if state.state in (state.DRIVING, state.PAUSED):
            self._go_on(PARKING, now_us)
            self._deviation = _deviation_text(state)
        elif state.state == state.PARKED:
            self._end(PARKING, StateInWords("parked", GOOD, self._deviation), now_us)
        elif state.state in (state.TIME_LIMIT, state.FAILED):
            gave_up = "gave up at the time limit" if state.state == state.TIME_LIMIT else ""
            words = (gave_up or reason or "the controller gave up", self._deviation)
            detail = ", ".join(filter(None, words))
            self._end(PARKING, StateInWords("not parked", WARN, detail), now_us)

    def take_sampler(self, state: lcmtypes.sampler_state_t, now_us: int) -> None:
        """Take a state of the sampler that arrived at ``now_us``."""
        if state.phase == state.DONE:
            words = ("calibrated", "not calibrated")
            end = _end_of(words, state.segments_done, state.segments_total, "segments")
            self._end(CALIBRATION, end, now_us)
        elif state.phase != state.WAIT:
            self._go_on(CALIBRATION, now_us)

    def take_reference(self, state: lcmtypes.reference_state_t, now_us: int) -> None:
        """Take a state of the node of reference runs that arrived at ``now_us``."""
        if state.phase == state.DONE:
            words = ("runs recorded", "not all runs")
            self._end(REFERENCE, _end_of(words, state.runs_done, state.runs_total, "runs"), now_us)
        elif state.phase != state.WAIT:
            self._go_on(REFERENCE, now_us)

    def _go_on(self, activity: str, now_us: int) -> None:
        drive = self._drive
        if drive is None or drive.end or drive.activity != activity or _silent(drive, now_us):
            self._drive = Drive(activity, now_us, now_us)
        else:
            self._drive = drive._replace(heard_us=now_us)

    def _end(self, activity: str, end: StateInWords, now_us: int) -> None:
        """Note an end once: it is said again and again."""
        drive = self._drive
        if drive is not None and drive.activity == activity and drive.end is None:
            self._drive = drive._replace(heard_us=now_us, end=end)


def _silent(drive: Drive, now_us: int) -> bool:
    return now_us - drive.heard_us > SILENT_S * US_PER_S


def _end_of(words: tuple[str, str], done: int, total: int, unit: str) -> StateInWords:
    """Return how a session ended: who gives up is done as well, with less than there was to do."""
    is_whole = 0 < total <= done
    good, bad = words
    return StateInWords(
        good if is_whole else bad, GOOD if is_whole else WARN, f"{done} of {total} {unit}"
    )


def _deviation_text(state: lcmtypes.mpc_state_t) -> str:
    """Return how far the robot is from the goal, in words; empty for nonsense."""
    x1, x2, theta = state.state_in_goal_frame[:3]
    if not all(map(math.isfinite, (x1, x2, theta))):
        return ""
    distance_m = math.hypot(x1, x2)
    shown = f"{distance_m * 1e3:.1f} mm" if distance_m < 0.1 else f"{distance_m:.2f} m"
    return f"{shown} and {abs(math.degrees(theta)):.1f}° from the goal"
