"""All claims of sections 4 to 6, in the order of the paper."""

from __future__ import annotations

from koopman_lab.paper import closed, dynamic, kinematic
from koopman_lab.paper.claim import Claim
from koopman_lab.paper.settings import SETTINGS as SETTINGS

CLAIMS: tuple[Claim, ...] = (
    *kinematic.CLAIMS,
    *dynamic.CLAIMS,
    *closed.CLOSED_LOOP,
    *closed.FEW_DATA,
)
