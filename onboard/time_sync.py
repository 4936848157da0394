"""Estimates offset and drift of the board's clock against the desk's, from pings and answers."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from koopman_lab.config.schema import ClockSync
from koopman_lab.units import PPM, US_PER_S

LONGEST_ROUND_TRIP_US = US_PER_S
"""Later answers tell nothing: they are a replayed log, or a desk that stood still."""
LARGEST_OFFSET_US = 2**61
"""Beyond this it is no clock."""
READING_ERROR_US = 2.0
"""Clocks are read in whole microseconds, twice on each side."""

SLOTS = 100
"""Number of slots of the window; each keeps its best sample."""


class Exchange(NamedTuple):
    """One ping and its answer: board, desk, desk, board (us)."""

    sent_us: int
    received_us: int
    answered_us: int
    arrived_us: int


@dataclass(slots=True)
class _Sample:
    """Desk minus board at a time of the board, within plus and minus ``error_us``."""

    at_us: float
    offset_us: float
    error_us: float
    round_trip_us: int


_error = attrgetter("error_us")


class TimeSync:
    """Maps times between two clocks; each error has a bound that holds whatever the radio does.

    An exchange tells the offset within half its round trip, since the ping took some time and so
    did the answer. The exchange whose bound, aged by what is not known of the drift, is smallest
    is the anchor of the map; the drift comes from the best exchanges of the first and the last
    third of the window, and counts as constant over it. The clock itself is never touched.

    Parameters
    ----------
    settings
        Window and largest drift.
    """

    def __init__(self, settings: ClockSync) -> None:
        self.drift = 0.0
        self.exchanges = 0
        self.restarts = 0
        self._window_us = settings.window_s * US_PER_S
        limit = settings.largest_drift_ppm * PPM
        # Of the desk against the board, which is a little more than of the board against the desk.
        self._largest_drift = limit / (1.0 - limit)
        self.drift_error = self._largest_drift
        self._samples: deque[_Sample] = deque()
        self._anchor: _Sample | None = None

    @property
    def synced(self) -> bool:
        """Return whether the offset is known at all."""
        return self._anchor is not None

    @property
    def round_trip_us(self) -> int:
        """Return the smallest round trip in the window (us)."""
        return min((s.round_trip_us for s in self._samples), default=0)

    def add(self, exchange: Exchange) -> bool:
        """Take in an exchange; return whether it tells anything."""
        sent, received, answered, arrived = exchange
        round_trip = (arrived - sent) - (answered - received)
        if not 0 <= arrived - sent <= LONGEST_ROUND_TRIP_US or answered < received:
            return False
        offset = ((received - sent) + (answered - arrived)) / 2
        error = round_trip / 2 + self._largest_drift * (arrived - sent) / 2 + READING_ERROR_US
        if error < 0.0 or abs(offset) > LARGEST_OFFSET_US:
            return False
        sample = _Sample((sent + arrived) / 2, offset, error, round_trip)
        if self._contradicts(sample):
            self._samples.clear()
            self.exchanges = 0
            self.restarts += 1
        self.exchanges += 1
        self._keep(sample)
        while sample.at_us - self._samples[0].at_us > self._window_us:
            self._samples.popleft()
        self._estimate_drift()
        drift_error = self.drift_error
        # As _error_us() says; over the whole window, a call more for each would be felt.
        self._anchor = min(
            self._samples, key=lambda s: s.error_us + drift_error * abs(arrived - s.at_us)
        )
        return True

    def offset_us(self, board_us: int) -> int:
        """Return desk minus board (us); 0 as long as nothing is known."""
        anchor = self._anchor
        if anchor is None:
            return 0
        # As _offset_us() says; asked with every message, a call more would be felt.
        return round(anchor.offset_us + self.drift * (board_us - anchor.at_us))

    def error_us(self, board_us: int) -> int | None:
        """Return the largest error of the offset (us); None as long as nothing is known."""
        return None if self._anchor is None else round(self._error_us(self._anchor, board_us)) + 1

    def to_desk(self, board_us: int) -> int:
        """Return the desk's time (us) at a time of the board."""
        return board_us + self.offset_us(board_us)

    def to_board(self, desk_us: int) -> int:
        """Return the board's time (us) at a time of the desk."""
        near_us = desk_us - self.offset_us(desk_us)
        return desk_us - self.offset_us(near_us)

    def _keep(self, sample: _Sample) -> None:
        """Keep the best sample of each slot, so that a small board has little to look through."""
        slot_us = self._window_us / SLOTS
        if self._samples and sample.at_us // slot_us == self._samples[-1].at_us // slot_us:
            if sample.error_us > self._samples[-1].error_us:
                return
            self._samples.pop()
        self._samples.append(sample)

    def _offset_us(self, anchor: _Sample, board_us: float) -> float:
        return anchor.offset_us + self.drift * (board_us - anchor.at_us)

    def _error_us(self, anchor: _Sample, board_us: float) -> float:
        return anchor.error_us + self.drift_error * abs(board_us - anchor.at_us)

    def _contradicts(self, sample: _Sample) -> bool:
        """Return whether a clock must have been set since the anchor."""
        if self._anchor is None:
            return False
        gap_us = abs(sample.offset_us - self._offset_us(self._anchor, sample.at_us))
        return gap_us > sample.error_us + self._error_us(self._anchor, sample.at_us)

    def _estimate_drift(self) -> None:
        limit = self._largest_drift
        self.drift, self.drift_error = 0.0, limit
        first_us, last_us = self._samples[0].at_us, self._samples[-1].at_us
        third_us = (last_us - first_us) / 3.0
        early_us, late_us = first_us + third_us, last_us - third_us
        early = min([s for s in self._samples if s.at_us <= early_us], key=_error)
        late = min([s for s in self._samples if s.at_us >= late_us], key=_error)
        apart_us = late.at_us - early.at_us
        error_us = late.error_us + early.error_us
        if error_us >= limit * apart_us:
            # So far the exchanges tell less than what is known of every crystal.
            return
        slope, error = (late.offset_us - early.offset_us) / apart_us, error_us / apart_us
        self.drift = max(-limit, min(limit, slope))
        low, high = max(-limit, slope - error), min(limit, slope + error)
        self.drift_error = max(high - self.drift, self.drift - low)
