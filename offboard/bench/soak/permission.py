"""When a robot may move, and how far it moved when it must not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from koopman_lab.units import US_PER_S
from offboard.bench.faults.stage import TruthSample


class Permission(NamedTuple):
    """A span of time in which a robot may move (us, by the stamps of its true motion)."""

    begin_us: float
    end_us: float


def way_m(before: TruthSample, after: TruthSample, half_track_m: float) -> float:
    """Return the way (m) of the faster wheel between two samples, by their mean velocity.

    By the velocity, since a robot that a hand places anew has not driven.
    """
    seconds = max(0, after.utime - before.utime) / US_PER_S
    forward = 0.5 * (abs(before.v_m_per_s) + abs(after.v_m_per_s))
    turning = 0.5 * (abs(before.omega_rad_per_s) + abs(after.omega_rad_per_s))
    return (forward + half_track_m * turning) * seconds


def forbidden_way_m(
    sights: Sequence[TruthSample], permissions: Iterable[Permission], half_track_m: float
) -> float:
    """Return how far a robot has driven outside of all permissions (m).

    Parameters
    ----------
    sights
        Its true motion, in the order of time. A step counts if it begins outside.
    permissions
        When it might move.
    half_track_m
        Distance of a wheel from the middle, so that turning in place counts as the wheels' way.
    """
    spans = list(permissions)
    return sum(
        way_m(before, after, half_track_m)
        for before, after in pairwise(sights)
        if not any(span.begin_us <= before.utime < span.end_us for span in spans)
    )
