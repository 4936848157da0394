"""All claims of sections 4 to 6, in the order of the paper."""

from __future__ import annotations

from offboard.reproduction.paper import (
    closed_loop_claims,
    dynamic_data_claims,
    kinematic_claims,
    open_loop_claims,
)
from offboard.reproduction.paper.claim import Claim

CLAIMS: tuple[Claim, ...] = (
    *kinematic_claims.CLAIMS,
    *dynamic_data_claims.DATA,
    *open_loop_claims.OPEN_LOOP,
    *closed_loop_claims.CLOSED_LOOP,
    *closed_loop_claims.FEW_DATA,
)
