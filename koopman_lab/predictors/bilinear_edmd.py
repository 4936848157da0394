"""The bilinear EDMD as a predictor, reprojected in each step (paper, sections 2.2 and 5.4)."""

from __future__ import annotations

from typing import Any

from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.predictor import StatePrediction


class KoopmanPrediction(StatePrediction):
    """A bilinear Koopman surrogate; see :class:`~.predictor.PredictionModel`.

    Parameters
    ----------
    model
        Learned from data.
    """

    def __init__(self, model: BilinearModel) -> None:
        self.robot = model.robot
        self.dictionary = model.dictionary
        self.dt_s = model.dt_s
        self.marker_offset = model.marker_offset
        self.parameters = model.parameters
        self.model = model
        self._step = model.casadi_step()

    def step(self, s: Any, u: Any, parameters: Any) -> Any:
        """Return the state one sampling time later."""
        return self._step(s, u, parameters)

    def without_reprojection(self) -> LiftedPrediction:
        """Return what propagates the observables as they are."""
        return LiftedPrediction(self.model)
