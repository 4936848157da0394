"""A learned model as a person uses it in Python, whatever predictor it is of."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from koopman_lab.api.arguments import Array, FilePath, rows
from koopman_lab.errors import ArgumentError
from koopman_lab.evaluation.fit_to_drive import STORED
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.evaluation.plausibility import Verdict, from_dict
from koopman_lab.predictors.predictor import LearnedModel
from koopman_lab.predictors.table import load_model
from koopman_lab.robots.robot_type import RobotType


class Model:
    """A model of a robot, learned from data.

    :func:`koopman_lab.train` makes one, :meth:`load` reads one that `klab train` or :meth:`save`
    wrote.

    Parameters
    ----------
    learned
        What predicts; stays within reach as :attr:`learned`.
    """

    def __init__(self, learned: LearnedModel) -> None:
        self.learned = learned
        """What predicts: for EDMD a :class:`~koopman_lab.koopman.bilinear_model.BilinearModel`."""

    @classmethod
    def load(cls, path: FilePath) -> Model:
        """Read a model file of any predictor.

        Raises
        ------
        ModelError
            If the file is missing, damaged, no model, of another version, or of a robot, a
            dictionary or a predictor that is not known here.
        PluginError
            If its predictor is another package's, and cannot be used.
        """
        return cls(load_model(Path(path)))

    def save(self, path: FilePath) -> None:
        """Write the model as one ``.npz`` file without pickle, whole or not at all.

        Raises
        ------
        DiskError
            If it cannot be written.
        """
        self.learned.save(Path(path))

    @property
    def name(self) -> str:
        """Return what to call it among others, for EDMD the name of its dictionary."""
        return self.learned.name

    @property
    def robot(self) -> RobotType:
        """Return which robot it describes: its states and inputs, their order and units."""
        return self.learned.robot

    @property
    def dt_s(self) -> float:
        """Return the sampling time in s."""
        return self.learned.dt_s

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Return where it comes from, as JSON: training, data, sources, versions, verdicts."""
        return self.learned.metadata

    @property
    def verdict(self) -> Verdict:
        """Return what was made of it when it was trained, or is now where it does not say."""
        stored = self.metadata.get(STORED, {}).get("model")
        return model_verdict(self.learned) if stored is None else from_dict(stored)

    def predict(self, x0: ArrayLike, inputs: ArrayLike, *, reproject: bool = True) -> Array:
        """Return the states (..., H + 1, n) from ``x0`` on, which is the first of them.

        Parameters
        ----------
        x0
            States (..., n) in the units of the robot's states, with angles of any number of turns.
        inputs
            Inputs (..., H, m), each held for one sampling time. The axes in front are those of
            ``x0``, or broadcast with them.
        reproject
            Whether each step ends on the manifold of the lifted states (paper, section 2.2), for
            models that lift.

        Raises
        ------
        ArgumentError
            If the shapes do not fit the robot or each other, or a number is not finite.
        """
        owner = f"the {self.robot.name} robot"
        x = rows(x0, "x0", self.robot.state_names, owner, "...")
        u = rows(inputs, "inputs", self.robot.input_names, owner, "..., H")
        try:
            leading = np.broadcast_shapes(x.shape[:-1], u.shape[:-2])
        except ValueError:
            raise ArgumentError(
                f"x0 of shape {x.shape} and inputs of shape {u.shape} do not go together: the axes "
                f"{x.shape[:-1]} and {u.shape[:-2]} before the last one and the last two must be "
                "the same, or broadcast"
            ) from None
        x = np.broadcast_to(x, (*leading, x.shape[-1]))
        u = np.broadcast_to(u, (*leading, *u.shape[-2:]))
        return self.learned.predict(x, u, reproject=reproject)

    def __repr__(self) -> str:
        return (
            f"Model({self.learned.predictor} {self.name} of the {self.robot.name} robot, "
            f"dt {self.dt_s:g} s, {self.verdict.level})"
        )


def as_model(model: Model | FilePath) -> Model:
    """Return a model, read from its file if it is a path."""
    return model if isinstance(model, Model) else Model.load(model)
