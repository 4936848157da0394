"""The receding horizon on the nominal equations, and with solvers that fail."""

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import ModelError
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.receding_horizon import RecedingHorizon, receding_horizon
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Plan, make_solver
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import robot_type

PARALLEL = np.array([0.0, 0.5, 0.0])
LAB_START = np.array([-1.1, -0.53, np.deg2rad(-42.68), 0.0, 0.0])
START = {"kinematic": PARALLEL, "dynamic": LAB_START}


class ScriptedSolver:
    """Answers as a script says: real, fails, worse or nan."""

    description = "a script"

    def __init__(self, solver, rollout, script):
        self.solver, self.rollout, self.script = solver, rollout, script
        self.guesses, self.plans = [], []

    def solve(self, x0, guess):
        self.guesses.append(guess)
        self.plans.append(self.answer(x0, guess))
        return self.plans[-1]

    def answer(self, x0, guess):
        answer = self.script
        if answer == "real":
            return self.solver.solve(x0, guess)
        inputs = np.full_like(guess, 0.4) if answer == "worse" else np.full_like(guess, np.nan)
        states, value = self.rollout(x0, inputs)
        return Plan(inputs, states, value, 3, answer != "fails", answer)


def make(robot, script, overrides=(), back_end="ddp"):
    config = load_config(robot=robot, overrides=overrides)
    settings = config.controller
    model, cost = (
        NominalPrediction(robot, settings.dt_s),
        stage_cost(settings, robot_type(robot)),
    )
    rollout = Rollout(model, cost, settings.horizon)
    solver = ScriptedSolver(
        make_solver(model, cost, settings.horizon, settings.u_max, back_end), rollout, script
    )
    return RecedingHorizon(solver, rollout, settings.u_max, settings.dt_s), solver


def nominal_loop(robot, overrides=()):
    config = load_config(robot=robot, overrides=overrides)
    return receding_horizon(NominalPrediction(robot, config.controller.dt_s), config), config


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_nominal_robot_reaches_the_goal_and_the_value_falls(robot):
    horizon, config = nominal_loop(robot)
    model, dt_s = robot_type(robot), config.controller.dt_s
    cost = stage_cost(config.controller, model)
    x, plans = START[robot], []
    for _ in range(200):
        decision = horizon.step(x)
        assert decision.solved
        if plans:
            # The shifted plan costs what the old one did, less its first stage, and one more
            # stage at the end: that bounds the value by dynamic programming.
            old = plans[-1]
            bound = old.value - cost(old.states[0], old.inputs[0])
            assert decision.plan.value <= bound + last_stage(model, cost, old, config) + 1e-9
        plans.append(decision.plan)
        x = model.step(x, decision.u, dt_s)
    assert abs(x[0]) <= 0.03
    assert abs(x[1]) <= 0.01
    assert abs(x[2]) <= np.deg2rad(5.0)
    assert np.all(np.abs(x[3:]) <= 0.01)


def last_stage(model, cost, plan, config):
    """Cost of braking in stage H of a plan and of the state after it, less what l(x_H, 0) was."""
    x, dt_s = plan.states[-1], config.controller.dt_s
    u = np.zeros(2)
    if len(x) == 5:
        bound = np.array(config.controller.u_max)
        u = np.clip(-x[3:] / dt_s, -bound, bound)
    return cost(x, u) - cost(x, np.zeros(2)) + cost(model.step(x, u, dt_s), np.zeros(2))


def test_parallel_parking_does_not_stay_at_the_stationary_point_of_no_input():
    horizon, config = nominal_loop("kinematic")
    first = horizon.step(PARALLEL)
    weight = config.controller.weights["me"].q[1]
    standing = (config.controller.horizon + 1) * weight * 0.5**2
    assert first.plan.value < 0.5 * standing
    assert np.abs(first.u).max() > 0.1


def test_the_first_step_takes_the_best_of_its_starts():
    # With cheap accelerations fatrop's starts end in different local minima.
    weights = "controller.weights.me={q: [1.0, 5.0, 0.1, 0.1, 0.1], r: [0.01, 0.01]}"
    horizon, solver = make("dynamic", "real", [weights], "fatrop")
    first = horizon.step(LAB_START)
    values = [plan.value for plan in solver.plans]
    assert first.plan.value == pytest.approx(min(values), rel=1e-6)
    assert max(values) > 1.2 * min(values)
    assert first.iterations == sum(plan.iterations for plan in solver.plans)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_when_the_solver_fails_the_plan_goes_on_and_ends_at_rest(robot):
    horizon, solver = make(robot, "real", ["controller.horizon=15"])
    dt_s, u_max = 0.05, load_config(robot=robot).controller.u_max
    model, x = robot_type(robot), START[robot]
    first = horizon.step(x)
    solver.script = "fails"
    x = model.step(x, first.u, dt_s)
    for k in range(1, 60):
        decision = horizon.step(x)
        assert not decision.solved
        assert decision.failures_in_a_row == k
        if k < 15:
            np.testing.assert_array_equal(decision.u, first.plan.inputs[k])
        assert np.all(np.abs(decision.u) <= u_max)
        x = model.step(x, decision.u, dt_s)
    np.testing.assert_allclose(decision.u, 0.0, atol=1e-9)
    np.testing.assert_allclose(x[3:], 0.0, atol=1e-9)


@pytest.mark.parametrize(("answer", "failures"), [("worse", 0), ("nan", 1)])
def test_a_plan_that_is_worse_or_not_finite_is_not_followed(answer, failures):
    horizon, solver = make("kinematic", "real")
    first = horizon.step(PARALLEL)
    solver.script = answer
    decision = horizon.step(first.plan.states[1])
    np.testing.assert_array_equal(decision.plan.inputs[:-1], first.plan.inputs[1:])
    np.testing.assert_array_equal(solver.guesses[-1], decision.plan.inputs)
    assert decision.failures_in_a_row == failures
    assert decision.solved == (failures == 0)


def test_a_success_ends_the_count_of_failures():
    horizon, solver = make("kinematic", "real")
    x = horizon.step(PARALLEL).plan.states[1]
    counts = []
    for answer in ("fails", "fails", "real", "fails"):
        solver.script = answer
        decision = horizon.step(x)
        counts.append(decision.failures_in_a_row)
        x = decision.plan.states[1]
    assert counts == [1, 2, 0, 1]


def test_until_the_first_plan_the_robot_stands_and_all_starts_are_tried_again():
    horizon, solver = make("kinematic", "fails")
    failed = horizon.step(PARALLEL)
    np.testing.assert_array_equal(failed.u, 0.0)
    tried = len(solver.guesses)
    solver.script = "real"
    assert np.abs(horizon.step(PARALLEL).u).max() > 0.1
    assert len(solver.guesses) == 2 * tried


def test_a_moving_second_order_robot_without_a_plan_brakes():
    horizon, _ = make("dynamic", "fails")
    decision = horizon.step(np.array([0.0, 0.0, 0.0, 0.3, -0.01]))
    np.testing.assert_allclose(decision.u, [-1.0, 0.2])
    np.testing.assert_allclose(decision.plan.states[-1, 3:], 0.0, atol=1e-12)


def test_models_that_do_not_fit_the_configuration_are_refused():
    config = load_config(robot="dynamic")
    with pytest.raises(ModelError, match=r"kinematic robot.*robot\.kind is dynamic"):
        receding_horizon(NominalPrediction("kinematic", 0.05), config)
    with pytest.raises(ModelError, match=r"0\.1 s.*controller\.dt_s"):
        receding_horizon(NominalPrediction("dynamic", 0.1), config)
