"""How far a body can get in a time."""

from __future__ import annotations

from typing import Any, NamedTuple

HASTE = 1.5
"""Assumption: a body may be so much faster than its limit, as set-points overshoot and it slips."""


class Reach(NamedTuple):
    """How far a body can get: speeds (m/s, rad/s), and what noise adds (m, rad)."""

    v_m_per_s: float
    omega_rad_per_s: float
    slack_m: float
    slack_rad: float

    def allows(self, time_s: Any, way_m: Any, turn_rad: Any) -> Any:
        """Return whether steps of a length (m) and a turn (rad) are possible in a time (s).

        Numbers, or arrays of equal shape; neither length nor turn is negative.
        """
        far = way_m <= HASTE * self.v_m_per_s * time_s + self.slack_m
        turned = turn_rad <= HASTE * self.omega_rad_per_s * time_s + self.slack_rad
        return far & turned
