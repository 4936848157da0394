"""The bilinear EDMD as a predictor without reprojection (paper, section 4)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.predictors.predictor import Propagated, RobotPrediction


class LiftedPrediction(RobotPrediction):
    """A bilinear Koopman surrogate that propagates observables; see :mod:`~.predictor`.

    They are propagated as they are. Where psi does not hold the angle, it is read off by the
    four-quadrant arctangent and lies in (-pi, pi].

    Parameters
    ----------
    model
        Learned from data.
    """

    propagates: Propagated = "observables"
    dictionary: Dictionary

    def __init__(self, model: BilinearModel) -> None:
        self.robot = model.robot
        self.dictionary = model.dictionary
        self.size = model.dictionary.size
        rows = [model.dictionary.state_rows[place] for place in model.robot.speeds_at]
        self.speeds_at = tuple(row for row in rows if row is not None)
        self.dt_s = model.dt_s
        self.marker_offset = model.marker_offset
        self.parameters = model.parameters
        self._step = model.casadi_lifted_step()

    def lift(self, x: Any) -> Any:
        """Return the observables of a state."""
        return ca.vertcat(*self.dictionary.observables(ca.vertsplit(x), ca))

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the observables one sampling time later."""
        return self._step(s, u, parameters)

    def state(self, s: Any) -> Any:
        """Return the state read off the observables."""
        return ca.vertcat(*self.dictionary.project_components(ca.vertsplit(s), None, ca))
