"""The bilinear Koopman surrogate: one matrix per basis input, and its reprojection."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.koopman.bilinear_model_file import content_of
from koopman_lab.koopman.combination import (
    PAPER,
    Combination,
    exponential_action,
    generators,
)
from koopman_lab.koopman.dictionary import (
    Dictionary,
)
from koopman_lab.koopman.expression import Components
from koopman_lab.koopman.model_file import EDMD, ModelFile, read_model_file, write_model_file
from koopman_lab.robots.robot_type import RobotType

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BilinearModel:
    """psi+ = M_u psi, with M_u from the matrices of the basis inputs (paper, section 2.2).

    The paper combines the matrices, M_u = M_0 + sum_i lambda_i (M_i - M_0); the other
    ``combination`` is that of their generators, see :mod:`koopman_lab.koopman.combination`.

    Parameters
    ----------
    dictionary
        The observables and their reprojection.
    matrices
        M_0, M_1, ..., M_m, shape (m + 1, M, M). They act on psi from the left; the paper's K is
        M^T.
    basis_inputs
        u_0, u_1, ..., u_m, shape (m + 1, m).
    dt_s
        Sampling time in s.
    metadata
        Where the model comes from; JSON.
    combination
        How the matrices of the basis inputs make that of an input.

    Raises
    ------
    ModelError
        If the arrays are not of the robot's number of inputs, the basis inputs do not span all
        inputs, or a matrix has no generator that could be combined.
    """

    dictionary: Dictionary
    matrices: Array
    basis_inputs: Array
    dt_s: float
    metadata: Mapping[str, Any]
    combination: Combination = PAPER
    predictor: ClassVar[str] = EDMD
    lifts: ClassVar[bool] = True

    def __post_init__(self) -> None:
        m, size = self.robot.input_dim, self.dictionary.size
        for what, array, expected in (
            ("matrices", self.matrices, (m + 1, size, size)),
            ("basis inputs", self.basis_inputs, (m + 1, m)),
        ):
            if array.shape != expected:
                raise ModelError(
                    f"model ({self.dictionary.name}) of the {self.robot.name} robot: {what} of "
                    f"shape {array.shape}, expected {expected}; train it again from its session"
                )
        _ = self._to_lambdas, self._combined

    @property
    def name(self) -> str:
        """Return the name of its dictionary, to tell it from others."""
        return self.dictionary.name

    @property
    def robot(self) -> RobotType:
        """Return the robot the model is of."""
        return self.dictionary.robot

    @property
    def state_dim(self) -> int:
        """Return the number n of states."""
        return self.dictionary.state_dim

    @property
    def marker_offset(self) -> Pose:
        """Return the pose of the tracked frame in the frame whose poses the model is of.

        That is where the markers were found to be if their offset was taken out of the data, and
        zero if the states are the tracked frame's own.
        """
        data = self.metadata.get("data", {})
        offset = data.get("marker", {}).get("offset")
        removed = data.get("processing", {}).get("remove_marker_offset")
        return Pose(*offset) if removed and offset is not None else ORIGIN

    @cached_property
    def _to_lambdas(self) -> Array:
        u0, *other_inputs = self.basis_inputs
        try:
            return np.linalg.inv(np.column_stack([u - u0 for u in other_inputs]))
        except np.linalg.LinAlgError:
            raise ModelError(
                f"model ({self.dictionary.name}): no input can be told from its basis inputs "
                f"{self.basis_inputs.tolist()}, which do not span all inputs; train from a session "
                "with other sampler.basis_inputs"
            ) from None

    def lambdas(self, u: Array) -> Array:
        """Return the lambda (..., m) with sum_i lambda_i (u_i - u_0) = u - u_0 of u (..., m)."""
        result: Array = (np.asarray(u, float) - self.basis_inputs[0]) @ self._to_lambdas.T
        return result

    @cached_property
    def _combined(self) -> Array:
        """What is combined: the matrices, or dt times their generators (m + 1, M, M)."""
        return self.matrices if self.combination == PAPER else generators(self.matrices)

    def matrix(self, u: Array) -> Array:
        """Return M_u (..., M, M) of inputs u (..., m)."""
        from scipy.linalg import expm

        m0, *other_matrices = self._combined
        lambdas = self.lambdas(u)[..., None, None]
        combined: Array = m0
        for index, matrix in enumerate(other_matrices):
            combined = combined + lambdas[..., index, :, :] * (matrix - m0)
        return combined if self.combination == PAPER else np.asarray(expm(combined))

    def step(self, x: Array, u: Array) -> Array:
        """Return the successors (..., n) of states x (..., n): lift, propagate, reproject.

        The angle is shifted to (-pi, pi] for the lift, as the paper does before it evaluates the
        model, and shifted back afterwards, so that it stays continuous.
        """
        x = np.asarray(x, float)
        states = [x[..., i] for i in range(self.state_dim)]
        turns = _turns(states[2], np)
        psi = self.dictionary.lift(np.stack([*states[:2], states[2] - turns, *states[3:]], axis=-1))
        psi_next = np.einsum("...ij,...j->...i", self.matrix(u), psi)
        x_next = self.dictionary.project(psi_next, states[2] - turns)
        x_next[..., 2] += turns
        return x_next

    def predict(self, x0: Array, inputs: Array, *, reproject: bool = True) -> Array:
        """Return the states (..., H + 1, n) from x0 (..., n) under inputs (..., H, m).

        Without reprojection the observables are propagated as they are, and each state is read
        off them.
        """
        x, inputs = np.asarray(x0, float), np.asarray(inputs, float)
        states, psi = [x], self.dictionary.lift(x)
        for k in range(inputs.shape[-2]):
            u = inputs[..., k, :]
            if reproject:
                x = self.step(x, u)
            else:
                psi = np.einsum("...ij,...j->...i", self.matrix(u), psi)
                x = self.dictionary.project(psi, x[..., 2])
            states.append(x)
        return np.stack(states, axis=-2)

    @cached_property
    def parameters(self) -> Array:
        """Return the model's numbers as one vector, for the functions of CasADi below.

        M_0, M_1 - M_0, ..., M_m - M_0, the matrix that takes u - u_0 to lambda, and u_0, each by
        columns; in place of the M_i, dt times their generators where those are combined. Models
        of one dictionary and combination differ in nothing else.
        """
        m0, *other_matrices = self._combined
        parts = (
            m0,
            *(matrix - m0 for matrix in other_matrices),
            self._to_lambdas,
            self.basis_inputs[0],
        )
        return np.concatenate([part.ravel(order="F") for part in parts])

    def casadi_step(self) -> Callable[[Any, Any, Any], Any]:
        """Return (x: SX (n,), u: SX (m,), p) -> SX (n,), the same step as :meth:`step`.

        p are the :attr:`parameters`, as numbers (DM) or symbols (SX).
        """
        import casadi as ca

        def step(x: Any, u: Any, parameters: Any) -> Any:
            states: Components = ca.vertsplit(x)
            turns = _turns(states[2], ca)
            states[2] = states[2] - turns
            psi = ca.vertcat(*self.dictionary.observables(states, ca))
            psi_next = ca.vertsplit(self._casadi_propagate(psi, u, parameters))
            projected = self.dictionary.project_components(psi_next, states[2], ca)
            projected[2] = projected[2] + turns
            return ca.vertcat(*projected)

        return step

    def casadi_lifted_step(self) -> Callable[[Any, Any, Any], Any]:
        """Return (psi: SX (M,), u: SX (m,), p) -> SX (M,), the step without reprojection."""
        return self._casadi_propagate

    def _casadi_propagate(self, psi: Any, u: Any, parameters: Any) -> Any:
        import casadi as ca

        size, m = self.dictionary.size, self.robot.input_dim
        shapes = [*[(size, size)] * (m + 1), (m, m), (m, 1)]
        ends = np.cumsum([0, *(rows * columns for rows, columns in shapes)]).tolist()
        m0, *differences, to_lambdas, u0 = (
            ca.reshape(part, *shape)
            for part, shape in zip(ca.vertsplit(parameters, ends), shapes, strict=True)
        )
        lambdas = to_lambdas @ (u - u0)
        combined = m0
        for index, difference in enumerate(differences):
            combined = combined + lambdas[index] * difference
        return combined @ psi if self.combination == PAPER else exponential_action(combined, psi)

    def save(self, path: Path) -> None:
        """Write the model as one ``.npz`` file without pickle, whole or not at all."""
        header = {
            "predictor": self.predictor,
            "robot": self.robot.name,
            "dictionary": self.dictionary.name,
            "observables": list(self.dictionary.names),
            "expressions": self.dictionary.expressions,
            "combination": self.combination,
            "dt_s": self.dt_s,
            "metadata": dict(self.metadata),
        }
        arrays = {"matrices": self.matrices, "basis_inputs": self.basis_inputs}
        write_model_file(path, header, arrays)

    @classmethod
    def load(cls, path: Path) -> BilinearModel:
        """Read a model file.

        Raises
        ------
        ModelError
            If the file is missing, damaged, no model, of another version, or of a robot or a
            dictionary that is not known here.
        """
        return cls.from_file(read_model_file(path))

    @classmethod
    def from_file(cls, file: ModelFile) -> BilinearModel:
        """Return the model that a file holds.

        Raises
        ------
        ModelError
            If it is another predictor's, lacks something, or is of a robot or a dictionary that is
            not known here.
        """
        return cls(**content_of(file)._asdict())


def _turns(theta: Any, m: Any) -> Any:
    """Return the multiple of 2 pi to take off an angle; locally constant, so no gradient."""
    return 2.0 * math.pi * m.floor((theta + math.pi) / (2.0 * math.pi))
