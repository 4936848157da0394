"""Where a log is that is sent again, as whoever sends it says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import REPLAY_CONTROL, REPLAY_STATE
from offboard.monitor.json_values import numbers
from offboard.monitor.latest_message import LatestMessage
from offboard.monitor.streams import Stream

YOUNG_S = 1.0
"""It is said five times a second."""


class ReplayProgress:
    """Follows the messages of one replay."""

    def __init__(self) -> None:
        self._latest = LatestMessage(REPLAY_STATE)
        self._seeks: int | None = None

    def take(
        self, channel: Channel[Any], data: bytes, arrived_us: int, streams: Iterable[Stream]
    ) -> bool:
        """Take a message; return whether it is one of a replay itself, and none of its log.

        Where the replay went on at another moment of the log since, nothing of what the streams
        miss was lost.
        """
        if channel is REPLAY_STATE:
            self._latest.take(data, arrived_us)
            state = self._latest.read()
            before, self._seeks = self._seeks, None if state is None else state.seeks
            if self._seeks not in (None, before):
                for stream in streams:
                    stream.forget_numbers()
        return channel in (REPLAY_STATE, REPLAY_CONTROL)

    def moment_us(self, now_us: int, heard_us: int | None, alive: Callable[[int], bool]) -> int:
        """Return the moment to show: now, or where a replay is paused, when it was heard last.

        Parameters
        ----------
        now_us, heard_us
            Present time, and when a message of the robot's arrived last (us).
        alive
            Returns whether somebody spoke at a time (us) who is no log; nobody who does is paused.
        """
        state = self._latest.young(now_us, YOUNG_S)
        if state is None or state.playing or heard_us is None or alive(heard_us):
            return now_us
        return min(now_us, heard_us)

    def control(self, now_us: int) -> int | None:
        """Return the number of what it obeyed last, None where no replay can be steered."""
        state = self._latest.young(now_us, YOUNG_S)
        return None if state is None else state.control

    def snapshot(self, now_us: int) -> dict[str, Any] | None:
        """Return what the page shows: moment, first and last one (s), and how it goes on.

        None where no replay can be steered.
        """
        state = self._latest.young(now_us, YOUNG_S)
        if state is None:
            return None
        names = ("position_s", "start_s", "end_s", "speed")
        values = numbers(*(getattr(state, name) for name in names))
        if None in values:
            return None
        flags = {"playing": bool(state.playing), "loop": bool(state.loop)}
        return dict(zip(names, values, strict=True)) | flags
