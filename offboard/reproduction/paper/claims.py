"""All claims of sections 4 to 6, in the order of the paper."""

from __future__ import annotations

from offboard.reproduction.paper import closed, dynamic, kinematic
from offboard.reproduction.paper.claim import Claim

CLAIMS: tuple[Claim, ...] = (
    *kinematic.CLAIMS,
    *dynamic.CLAIMS,
    *closed.CLOSED_LOOP,
    *closed.FEW_DATA,
)
