"""The nominal equations of a robot by its name."""

from __future__ import annotations

from koopman_lab.robots.dynamic import DYNAMIC as DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC as KINEMATIC
from koopman_lab.robots.table import robot_type as nominal_model

__all__ = ["DYNAMIC", "KINEMATIC", "nominal_model"]
