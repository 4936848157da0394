"""The radio between desk and robot: what it does to each message, one direction at a time."""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np

from koopman_lab.config import simulation
from koopman_lab.units import US_PER_S

SEED_STREAM = 3
"""Number of the radio's among the generators that grow from ``config.seed``."""


class Radio:
    """One direction of the radio.

    Messages wait in one queue, as at an access point: jitter delays those behind, too, and only
    those that are held back are overtaken. A burst loses everything sent while it lasts.

    Parameters
    ----------
    link
        How good the radio is.
    rng
        Decides for each message.
    """

    def __init__(self, link: simulation.RadioLink, rng: np.random.Generator) -> None:
        self._delay_s, self._jitter_s = link.delay_s, link.jitter_s
        self._loss, self._duplication = link.loss, link.duplication
        self._reordering, self._held_back_us = link.reordering, round(link.held_back_s * US_PER_S)
        self._burst_rate_hz, self._burst_s = link.burst_rate_hz, link.burst_s
        self._rng = rng
        self._newest_us = 0
        self._burst_start_us = 0.0
        self._burst_end_us: float | None = None

    def arrivals(self, now_us: int, loss: float = 0.0) -> tuple[int, ...]:
        """Return when each copy of a message sent at ``now_us`` arrives (us); none if it is lost.

        Calls come in order of time. ``loss`` is the share that a fault loses, if that is more.
        """
        rng = self._rng
        if self._burst_rate_hz and self._in_burst(now_us):
            return ()
        if rng.random() < max(self._loss, loss):
            return ()
        if rng.random() < self._duplication:
            return self._arrival(now_us), self._arrival(now_us)
        return (self._arrival(now_us),)

    def _arrival(self, now_us: int) -> int:
        rng = self._rng
        delay_s = self._delay_s + self._jitter_s * rng.standard_exponential()
        due_us = max(now_us + round(delay_s * US_PER_S), self._newest_us)
        if rng.random() < self._reordering:
            return due_us + self._held_back_us
        self._newest_us = due_us
        return due_us

    def _in_burst(self, now_us: int) -> bool:
        rng, rate_hz = self._rng, self._burst_rate_hz
        if self._burst_end_us is None:
            self._burst_end_us = now_us
        while now_us >= self._burst_end_us:
            pause_s = rng.standard_exponential() / rate_hz
            self._burst_start_us = self._burst_end_us + pause_s * US_PER_S
            length_s = self._burst_s * rng.standard_exponential()
            self._burst_end_us = self._burst_start_us + length_s * US_PER_S
        return now_us >= self._burst_start_us


class RadioPair(NamedTuple):
    """Both directions, each with a generator of its own."""

    to_robot: Radio
    from_robot: Radio


def radio_pair(links: simulation.Radio, seed: int, robot_name: str) -> RadioPair:
    """Return the radio of one robot; robots that share a bus do not share their luck."""
    robot = zlib.crc32(robot_name.encode())
    seeds = np.random.SeedSequence([seed, SEED_STREAM, robot]).spawn(2)
    to_robot, from_robot = map(np.random.default_rng, seeds)
    return RadioPair(Radio(links.to_robot, to_robot), Radio(links.from_robot, from_robot))
