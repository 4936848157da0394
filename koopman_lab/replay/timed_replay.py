"""Sends a log again, in real time and in its own rhythm, so that listeners see it as live."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from koopman_lab.bus.channels import split_name
from koopman_lab.errors import BusError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.playback import Playback
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
        Time it took (s), that in which it was paused included.
    latest_s
        By how much the latest event was sent behind its time (s).
    """

    events: int
    took_s: float
    latest_s: float


class Sender(Protocol):
    """What takes the events: LCM."""

    def publish(self, channel: str, data: bytes) -> None:
        """Send a message."""


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


def clock_us() -> int:
    """Return the time of the clock that replays go by (us)."""
    return time.monotonic_ns() // 1000


class Replay:
    """Sends the events of a log as a :class:`~koopman_lab.replay.playback.Playback` says.

    Parameters
    ----------
    events, playback
        What to send, bytes unchanged, and when. The deadlines are absolute, so that lateness never
        adds up.
    bus
        Takes the events.
    """

    def __init__(self, events: Sequence[Event], playback: Playback, bus: Sender) -> None:
        self._events = events
        self._playback = playback
        self._bus = bus
        self._numbers: dict[str, list[int]] | None = None

    def run(
        self,
        on_progress: Callable[[float], None],
        wait: Callable[[float], object] = time.sleep,
    ) -> ReplayResult:
        """Send until nothing will be due any more.

        Parameters
        ----------
        on_progress
            Told several times a second which time of the log has been reached (s).
        wait
            Waits for at most so long (s); may steer the playback meanwhile. Called several times a
            second also where there is no time to wait.

        Raises
        ------
        BusError
            If the bus refuses an event.
        """
        playback, start_us, report_us = self._playback, clock_us(), 0
        sent, latest_us = 0, 0
        playback.seek(playback.start_us, start_us)  # it may have been made a while ago
        if not playback.playing:
            self.show_present()
        while not playback.finished:
            now_us = clock_us()
            for number in playback.take(now_us):
                latest_us = max(latest_us, playback.lateness_us(number, clock_us()))
                self._send(number)
                sent += 1
            now_us = clock_us()
            due_us = playback.wait_us(now_us)
            if now_us >= report_us:
                report_us = now_us + round(REPORT_PERIOD_S * US_PER_S)
                on_progress(playback.position_us(now_us) / US_PER_S)
            elif due_us == 0:
                continue
            longest_us = report_us - now_us
            wait(min(longest_us if due_us is None else due_us, longest_us) / US_PER_S)
        on_progress(playback.position_us(clock_us()) / US_PER_S)
        return ReplayResult(sent, (clock_us() - start_us) / US_PER_S, latest_us / US_PER_S)

    def show_present(self) -> None:
        """Send what each channel said last before the present moment of the log.

        So who looks on sees that moment also where the replay is paused. What a person ordered is
        no state, and is not said again.

        Raises
        ------
        BusError
            If the bus refuses an event.
        """
        if self._numbers is None:
            self._numbers = {}
            for number, event in enumerate(self._events):
                self._numbers.setdefault(event.channel, []).append(number)
        latest = []
        for name, numbers in self._numbers.items():
            before = bisect_left(numbers, self._playback.next_event)
            if before and not _is_order(name):
                latest.append(numbers[before - 1])
        for number in sorted(latest):
            self._send(number)

    def _send(self, number: int) -> None:
        event = self._events[number]
        try:
            self._bus.publish(event.channel, event.data)
        except OSError:
            raise BusError(
                f"{event.channel}: LCM refuses event {event.number} ({len(event.data)} bytes); "
                "`klab doctor` looks at the bus"
            ) from None


def _is_order(name: str) -> bool:
    try:
        return split_name(name)[1].rate == "event"
    except BusError:
        return False
