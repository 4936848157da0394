"""Our back end where it must not rely on a good guess."""

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.solver import make_solver
from koopman_lab.mpc.stage_costs import Quadratic
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC

HORIZON = 12


@pytest.fixture(scope="module")
def solver():
    settings = load_config(robot="dynamic").controller
    model = NominalPrediction("dynamic", 0.05)
    return make_solver(model, stage_cost(settings, DYNAMIC), HORIZON, (1.0, 3.0))


def test_at_the_goal_there_is_nothing_to_do(solver):
    plan = solver.solve(np.zeros(5), np.zeros((HORIZON, 2)))
    assert (plan.ok, plan.value, plan.iterations) == (True, 0.0, 0)
    np.testing.assert_array_equal(plan.inputs, 0.0)


def test_from_any_guess_the_value_falls_and_the_bounds_hold(solver):
    rng = np.random.default_rng(0)
    for _ in range(20):
        x0, guess = rng.normal(size=5), 3.0 * rng.normal(size=(HORIZON, 2))
        plan = solver.solve(x0, guess)
        _, before = solver.rollout(x0, np.clip(guess, [-1.0, -3.0], [1.0, 3.0]))
        assert plan.ok
        assert plan.status == "ddp: converged"
        assert plan.value <= before
        assert np.all(np.abs(plan.inputs) <= [1.0, 3.0])
        again = solver.solve(x0, plan.inputs)
        assert again.value == pytest.approx(plan.value, rel=1e-6)
        assert again.iterations <= 2


def test_what_is_not_finite_is_said_to_be_no_plan(solver):
    for x0, guess in ((np.full(5, np.nan), 0.0), (np.zeros(5), np.nan), (np.full(5, 1e100), 0.1)):
        plan = solver.solve(x0, np.full((HORIZON, 2), guess))
        assert not plan.ok


def test_too_few_iterations_count_if_they_improve_the_guess():
    settings = load_config(robot="kinematic").controller
    model = NominalPrediction("kinematic", 0.05)
    once = make_solver(
        model, stage_cost(settings, KINEMATIC), HORIZON, (0.4, 1.5), most_iterations=1
    )
    x0, guess = np.array([0.5, 0.4, 0.3]), np.full((HORIZON, 2), 0.1)
    plan = once.solve(x0, guess)
    assert plan.ok
    assert plan.iterations == 1
    assert plan.status == "ddp: not converged"
    assert plan.value < once.rollout(x0, guess)[1]


def test_linear_motion_has_the_closed_form_of_least_squares():
    # Straight ahead x1 moves by dt v: the optimum solves a linear system.
    dt_s, q, r, x1 = 0.1, 2.0, 0.3, 0.2
    cost = Quadratic((q, 1.0, 1.0), (r, 1.0))
    solver = make_solver(NominalPrediction("kinematic", dt_s), cost, HORIZON, (1.0, 1.0))
    plan = solver.solve(np.array([x1, 0.0, 0.0]), np.zeros((HORIZON, 2)))
    sums = dt_s * np.tril(np.ones((HORIZON, HORIZON)))
    v = np.linalg.solve(q * sums.T @ sums + r * np.eye(HORIZON), -q * x1 * sums.sum(axis=0))
    np.testing.assert_allclose(plan.inputs[:, 0], v, atol=1e-9)
    np.testing.assert_allclose(plan.inputs[:, 1], 0.0, atol=1e-12)
    assert plan.iterations <= 2


class TwoWells:
    """A cost with a minimum for either sign of an input; the negative one is lower."""

    parameters = np.array([0.1])

    def __call__(self, _x, u, parameters=None):
        tilt = self.parameters if parameters is None else parameters
        return (u[0] ** 2 - 1.0) ** 2 + tilt[0] * (u[0] + 1.0) ** 2 + u[1] ** 2


def test_where_the_value_curves_down_the_other_sign_of_an_input_is_tried():
    model, cost = NominalPrediction("kinematic", 0.1), TwoWells()
    solver = make_solver(model, cost, HORIZON, (2.0, 2.0))
    plan = solver.solve(np.zeros(3), np.full((HORIZON, 2), 0.3))
    assert plan.ok
    np.testing.assert_allclose(plan.inputs, np.tile([-1.0, 0.0], (HORIZON, 1)), atol=1e-4)
