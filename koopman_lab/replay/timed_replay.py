"""Sends a log again, in real time and in its own rhythm, so that listeners see it as live."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import lcm

from koopman_lab.errors import BusError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.units import US_PER_S

LARGEST_PAUSE_S = 60.0
"""A longer step between two events is a clock that was set, or a damaged time: nobody waits."""
REPORT_PERIOD_S = 0.2


class ReplayResult(NamedTuple):
    """How a replay went.

    Attributes
    ----------
    events
        Sent.
    took_s
        Time it took (s).
    latest_s
        By how much the latest event was sent behind its time (s).
    """

    events: int
    took_s: float
    latest_s: float


def rhythm(timestamps_us: Sequence[int]) -> tuple[list[int], int]:
    """Return when each event is due after the first (us), and how many steps count as none.

    Times that step backwards or by more than a minute tell of a clock and not of a pause.
    """
    due, jumps, at_us = [], 0, 0
    before_us = timestamps_us[0] if timestamps_us else 0
    for now_us in timestamps_us:
        step_us = now_us - before_us
        if 0 <= step_us <= LARGEST_PAUSE_S * US_PER_S:
            at_us += step_us
        else:
            jumps += 1
        due.append(at_us)
        before_us = now_us
    return due, jumps


def replay(
    events: Sequence[Event],
    due_us: Sequence[int],
    bus: lcm.LCM,
    speed: float,
    on_progress: Callable[[float], None],
) -> ReplayResult:
    """Send every event, bytes unchanged, ``due_us / speed`` after the first.

    Deadlines are absolute, so that lateness never adds up.

    Parameters
    ----------
    events, due_us
        What to send, and when (us after the first; see :func:`rhythm`).
    bus
        Takes the events.
    speed
        Factor, above 0.
    on_progress
        Told several times a second which time of the log has been reached (s).

    Raises
    ------
    BusError
        If the bus refuses an event.
    """
    start_s = report_s = time.monotonic()
    latest_s = 0.0
    for event, due in zip(events, due_us, strict=True):
        deadline_s = start_s + due / US_PER_S / speed
        while (wait_s := deadline_s - time.monotonic()) > 0.0:
            if wait_s > REPORT_PERIOD_S:
                on_progress(due / US_PER_S - wait_s * speed)
            time.sleep(min(wait_s, REPORT_PERIOD_S))
        latest_s = max(latest_s, -wait_s)
        try:
            bus.publish(event.channel, event.data)
        except OSError:
            raise BusError(
                f"{event.channel}: LCM refuses event {event.number} ({len(event.data)} bytes); "
                "`klab doctor` looks at the bus"
            ) from None
        if deadline_s > report_s:
            report_s = deadline_s + REPORT_PERIOD_S
            on_progress(due / US_PER_S)
    on_progress(due_us[-1] / US_PER_S if due_us else 0.0)
    return ReplayResult(len(events), time.monotonic() - start_s, latest_s)
