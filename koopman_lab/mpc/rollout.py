"""Trajectories of a prediction model and what they cost."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc.stage_costs import StageCost, cost_of
from koopman_lab.predictors.predictor import PredictionModel

Array = NDArray[np.float64]
FUNCTION = "rollout"
"""Name of the function in a library."""


class Trajectory(NamedTuple):
    """What a model does under inputs.

    Attributes
    ----------
    propagated
        What the model propagates, (H + 1, S).
    states
        The robot's states that it stands for, (H + 1, n).
    value
        Sum of the stage costs.
    """

    propagated: Array
    states: Array
    value: float


class Call:
    """A CasADi function called on arrays that stay where they are; not for two threads at once.

    What CasADi does with the arguments of an ordinary call takes longer than the function itself.
    A matrix (R, C) is an array (C, R) here, because CasADi stores columns.

    Parameters
    ----------
    function
        A function with any number of arguments and results, all dense.
    """

    def __init__(self, function: Any) -> None:
        self._buffer, self.run = function.buffer()
        self.arguments = [_array(function.sparsity_in(i)) for i in range(function.n_in())]
        self.results = [_array(function.sparsity_out(i)) for i in range(function.n_out())]
        for index, array in enumerate(self.arguments):
            self._buffer.set_arg(index, array.data)
        for index, array in enumerate(self.results):
            self._buffer.set_res(index, array.data)

    def statistics(self) -> dict[str, Any]:
        """Return what the function tells of its last run."""
        statistics: dict[str, Any] = self._buffer.stats()
        return statistics


class Rollout:
    """Simulates a model under a sequence of inputs and adds up the stage costs.

    The cost is that of the optimal control problem: H stages with inputs and one without. One
    instance serves one thread.

    Parameters
    ----------
    model
        Predicts the robot.
    cost
        Cost of a stage.
    horizon
        Number of inputs H.
    library
        Holds :func:`function` compiled; None to do without.
    """

    def __init__(
        self, model: PredictionModel, cost: StageCost, horizon: int, library: Path | None = None
    ) -> None:
        self.horizon = horizon
        self.robot = model.robot
        dim = model.disturbance_dim
        self._disturbed = disturbance_slice(model)
        numbers = np.concatenate([model.parameters, cost.parameters])
        evaluated = function(model, cost, horizon) if library is None else None
        self._call = Call(evaluated or ca.external(FUNCTION, str(library)))
        self._call.arguments[2][:] = numbers
        x, u = ca.SX.sym("x", model.state_dim), ca.SX.sym("u", model.input_dim)
        d = ca.SX.sym("d", dim)
        p = ca.vertcat(ca.DM(model.parameters[: len(model.parameters) - dim]), d)
        s, w = model.lift(x), ca.DM(cost.parameters)
        following, stage = model.state(model.step(s, u, p)), cost_of(model, cost, s, u, w)
        self._one_step = Call(
            ca.Function("once", [x, u, d], [ca.densify(following), ca.densify(stage)])
        )

    def disturb(self, d: Array) -> None:
        """Let the model predict with other last parameters (its ``disturbance_dim``,)."""
        self._call.arguments[2][self._disturbed] = d
        self._one_step.arguments[2][:] = d

    def trajectory(self, x0: Array, inputs: Array) -> Trajectory:
        """Return what happens from the state ``x0`` (n,) on under ``inputs`` (H, m)."""
        call = self._call
        call.arguments[0][:], call.arguments[1][:] = x0, inputs
        call.run()
        propagated, states, value = call.results
        return Trajectory(propagated.copy(), states.copy(), float(value[0]))

    def __call__(self, x0: Array, inputs: Array) -> tuple[Array, float]:
        """Return the states (H + 1, n) that begin with ``x0`` (n,), and the sum of the costs.

        Parameters
        ----------
        x0
            State (n,).
        inputs
            Inputs (H, m).
        """
        trajectory = self.trajectory(x0, inputs)
        return trajectory.states, trajectory.value

    def advance(self, x: Array, u: Array) -> Array:
        """Return the state (n,) one sampling time after ``x`` (n,) under ``u`` (m,)."""
        return self._at(x, u)[0].copy()

    def stage_cost(self, x: Array, u: Array) -> float:
        """Return what a stage costs in the state ``x`` (n,) under ``u`` (m,)."""
        return float(self._at(x, u)[1][0])

    def _at(self, x: Array, u: Array) -> list[Array]:
        self._one_step.arguments[0][:], self._one_step.arguments[1][:] = x, u
        self._one_step.run()
        return self._one_step.results


def disturbance_slice(model: PredictionModel) -> slice:
    """Return the place of the parameters of a model that may change between two problems."""
    return slice(model.parameters.size - model.disturbance_dim, model.parameters.size)


def function(model: PredictionModel, cost: StageCost, horizon: int) -> Any:
    """Return the CasADi function of state, inputs (m, H) and numbers of model and cost.

    Its results are the fields of :class:`Trajectory`, a column for each stage.
    """
    n, m, size = model.state_dim, model.input_dim, model.size
    s, x, u = ca.SX.sym("s", size), ca.SX.sym("x", n), ca.SX.sym("u", m)
    p, w = ca.SX.sym("p", model.parameters.size), ca.SX.sym("w", cost.parameters.size)
    lift = ca.Function("lift", [x], [ca.densify(model.lift(x))])
    step = ca.Function("roll", [s, u, p], [ca.densify(model.step(s, u, p))])
    state = ca.Function("state", [s], [ca.densify(model.state(s))])
    stage = ca.Function("stage", [s, u, w], [cost_of(model, cost, s, u, w)])
    x0, inputs = ca.MX.sym("x0", n), ca.MX.sym("inputs", m, horizon)
    numbers = ca.MX.sym("numbers", p.numel() + w.numel())
    of_model, weights = ca.vertsplit(numbers, [0, p.numel(), numbers.numel()])
    course = [lift(x0)]
    for k in range(horizon):
        course.append(step(course[-1], inputs[:, k], of_model))
    propagated = ca.horzcat(*course)
    # The initial state is not read off, so that its angle is as it was given.
    later_states = state.map(horizon)(propagated[:, 1:])
    costs = stage.map("each_stage", "serial", horizon + 1, [2], [])(
        propagated, ca.horzcat(inputs, ca.DM.zeros(m, 1)), weights
    )
    return ca.Function(
        FUNCTION, [x0, inputs, numbers], [propagated, ca.horzcat(x0, later_states), ca.sum2(costs)]
    )


def _array(sparsity: Any) -> Array:
    rows, columns = sparsity.shape
    return np.zeros(rows) if columns == 1 else np.zeros((columns, rows))
