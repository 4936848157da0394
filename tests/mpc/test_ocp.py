"""The transcription, and both solvers of it."""

import casadi as ca
import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.trainer import train
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.ocp import Bounds, bounds_for, transcribe
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import NlpSolver, make_solver
from koopman_lab.mpc.stage_costs import MixedExponents
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.table import robot_type

STARTS = {
    "kinematic": [[0.0, 0.5, 0.0], [-1.0, -0.5, -0.52], [0.01, 0.004, 0.02]],
    "dynamic": [[-1.1, -0.53, -0.745, 0.0, 0.0], [1.0, 0.2, 0.785, 0.1, -0.3]],
}
BACK_ENDS = [("ddp", True), ("fatrop", True), ("fatrop", False), ("ipopt", False)]
PROBLEMS = [(robot, tuple(x0)) for robot, starts in STARTS.items() for x0 in starts]


@pytest.fixture(scope="module")
def solvers():
    made = {}
    for robot in STARTS:
        settings = load_config(robot=robot).controller
        model, cost = (
            NominalPrediction(robot, settings.dt_s),
            stage_cost(settings, robot_type(robot)),
        )
        made[robot] = [
            make_solver(
                model, cost, settings.horizon, settings.u_max, back_end, 200, use_compiler=compiler
            )
            for back_end, compiler in BACK_ENDS
        ]
    return made


def bounds(*u_max):
    return Bounds(np.array(u_max))


def guess_for(robot, x0=(1.0,)):
    """Return a guess that leads away no farther than the goal is, or local minima differ."""
    settings = load_config(robot=robot).controller
    effort = 0.25 * min(1.0, 2.0 * np.abs(x0).max())
    return np.tile(effort * np.array(settings.u_max), (settings.horizon, 1))


@pytest.mark.parametrize(("robot", "x0"), PROBLEMS)
def test_all_solvers_reach_the_same_objective_from_the_same_guess(solvers, robot, x0):
    *plans, ipopt = [s.solve(np.array(x0), guess_for(robot, x0)) for s in solvers[robot]]
    assert ipopt.ok
    for plan in plans:
        assert plan.ok
        assert plan.value == pytest.approx(ipopt.value, rel=1e-6)


@pytest.mark.parametrize(("robot", "x0"), PROBLEMS)
def test_a_plan_obeys_the_bounds_the_model_and_the_cost(solvers, robot, x0):
    settings = load_config(robot=robot).controller
    plan = solvers[robot][0].solve(np.array(x0), guess_for(robot))
    assert plan.inputs.shape == (settings.horizon, 2)
    assert np.all(np.abs(plan.inputs) <= settings.u_max)
    np.testing.assert_array_equal(plan.states[0], x0)
    followed = robot_type(robot).step(plan.states[:-1], plan.inputs, settings.dt_s)
    np.testing.assert_allclose(plan.states[1:], followed, atol=1e-8)
    cost, no_input = stage_cost(settings, robot_type(robot)), np.zeros(2)
    stages = sum(cost(x, u) for x, u in zip(plan.states, plan.inputs, strict=False))
    assert plan.value == pytest.approx(stages + cost(plan.states[-1], no_input), rel=1e-12)


@pytest.mark.parametrize(("robot", "x0"), PROBLEMS)
def test_no_small_change_of_the_inputs_makes_a_plan_cheaper(solvers, robot, x0):
    settings = load_config(robot=robot).controller
    model = NominalPrediction(robot, settings.dt_s)
    cost = stage_cost(settings, model.robot)
    rollout = Rollout(model, cost, settings.horizon)
    plan = solvers[robot][0].solve(np.array(x0), guess_for(robot))
    rng, bound = np.random.default_rng(1), np.array(settings.u_max)
    for size in (1e-2, 1e-3, 1e-4):
        for _ in range(30):
            changed = plan.inputs + size * bound * rng.normal(size=plan.inputs.shape)
            _, value = rollout(plan.states[0], np.clip(changed, -bound, bound))
            assert value >= plan.value * (1.0 - 1e-6)


def test_one_step_straight_ahead_has_the_closed_form():
    # Minimise r v^4 + q (x1 + dt v)^4: r v^3 = -q dt (x1 + dt v)^3, so v = -c (x1 + dt v).
    q, r, dt, x1 = 1.0, 0.5, 0.1, 0.8
    model, cost = NominalPrediction("kinematic", dt), MixedExponents((q, 5.0, 0.1), (r, 0.05), (1,))
    c = (q * dt / r) ** (1.0 / 3.0)
    for back_end in ("ddp", "fatrop", "ipopt"):
        solver = make_solver(model, cost, 1, (1.0, 1.0), back_end)
        plan = solver.solve(np.array([x1, 0.0, 0.0]), np.full((1, 2), 0.1))
        assert plan.inputs[0, 0] == pytest.approx(-c * x1 / (1.0 + c * dt), rel=1e-4)
        assert plan.inputs[0, 1] == pytest.approx(0.0, abs=1e-2)
        capped = make_solver(model, cost, 1, (0.2, 1.0), back_end)
        at_bound = capped.solve(np.array([x1, 0.0, 0.0]), np.full((1, 2), 0.1))
        assert at_bound.inputs[0, 0] == pytest.approx(-0.2, rel=1e-6)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_simulated_trajectory_closes_all_gaps_and_has_the_objective_of_the_rollout(robot):
    horizon, factor, rng = 7, 3.0, np.random.default_rng(2)
    settings = load_config(robot=robot).controller
    model = NominalPrediction(robot, settings.dt_s)
    cost = stage_cost(settings, model.robot)
    problem = transcribe(model, cost, horizon, bounds(1.0, 2.0))
    x0, inputs = rng.normal(size=model.state_dim), rng.normal(size=(horizon, 2))
    states, value = Rollout(model, cost, horizon)(x0, inputs)
    variables = problem.pack(states, inputs)
    p = problem.program
    evaluate = ca.Function("evaluate", [p["x"], p["p"]], [p["f"], p["g"]])
    objective, gaps = evaluate(variables, np.append(x0, factor))
    assert float(objective) == pytest.approx(factor * value, rel=1e-12)
    np.testing.assert_allclose(np.asarray(gaps), 0.0, atol=1e-12)
    states_again, inputs_again = problem.unpack(variables)
    np.testing.assert_array_equal(states_again, states)
    np.testing.assert_array_equal(inputs_again, inputs)


def test_inputs_are_bounded_and_speeds_only_if_asked_for():
    settings = load_config(robot="dynamic").controller
    model, cost = NominalPrediction("dynamic", settings.dt_s), stage_cost(settings, DYNAMIC)
    problem = transcribe(model, cost, 3, bounds(1.0, 2.0))
    states, inputs = problem.unpack(problem.upper(np.zeros(5)))
    assert np.all(np.isinf(states))
    np.testing.assert_array_equal(inputs, np.tile([1.0, 2.0], (3, 1)))
    limited = bounds_for(model, (1.0, 2.0), (0.3, 0.9))
    problem = transcribe(model, cost, 3, limited)
    states, _ = problem.unpack(problem.upper(np.array([0.0, 0.0, 0.0, -0.35, 0.5])))
    assert np.all(np.isinf(states[0]))
    assert np.all(np.isinf(states[:, :3]))
    # Too fast at first, it must brake with half of 1 m/s^2 at least.
    np.testing.assert_allclose(states[1:, 3], [0.325, 0.3, 0.3])
    np.testing.assert_allclose(states[1:, 4], 0.9)


@pytest.fixture(scope="module")
def surrogate():
    return train(ideal_dataset("dynamic", segments=20), "D8Eul")[0]


def test_a_plan_keeps_to_bounds_of_the_speeds(surrogate):
    settings, x0 = load_config(robot="dynamic").controller, np.array([-1.0, 0.0, 0.0, 0.0, 0.0])
    plans = [
        make_solver(
            *(
                LiftedPrediction(surrogate),
                stage_cost(settings, surrogate.robot),
                20,
                settings.u_max,
                "fatrop",
            ),
            speed_max=limit,
            use_compiler=False,
        ).solve(x0, np.full((20, 2), 0.01))
        for limit in (None, (0.2, 0.5))
    ]
    assert all(plan.ok for plan in plans)
    assert plans[0].states[:, 3].max() > 0.25
    assert plans[1].states[:, 3].max() == pytest.approx(0.2, abs=1e-4)


def test_all_solvers_agree_without_reprojection(surrogate):
    settings = load_config(robot="dynamic", overrides=["controller.cost=ds"]).controller
    model, cost = (
        LiftedPrediction(surrogate),
        stage_cost(settings, surrogate.robot, surrogate.dictionary),
    )
    x0, guess = np.array([1.0, 0.2, 0.785, 0.1, -0.3]), np.full((20, 2), 0.1)
    *plans, ipopt = (
        make_solver(model, cost, 20, settings.u_max, back_end, 200).solve(x0, guess)
        for back_end in ("ddp", "fatrop", "ipopt")
    )
    assert ipopt.ok
    for plan in plans:
        assert plan.ok
        assert plan.value == pytest.approx(ipopt.value, rel=1e-6)
        predicted = surrogate.predict(x0, plan.inputs, reproject=False)
        np.testing.assert_allclose(plan.states, predicted, atol=1e-12)


@pytest.mark.parametrize("back_end", range(len(BACK_ENDS)))
def test_solving_is_silent_and_repeatable(solvers, capfd, back_end):
    solver, x0 = solvers["kinematic"][back_end], np.array([0.0, 0.5, 0.0])
    first = solver.solve(x0, guess_for("kinematic"))
    solver.solve(np.array([1.0, -0.4, 2.0]), guess_for("kinematic"))
    again = solver.solve(x0, guess_for("kinematic"))
    np.testing.assert_array_equal(first.inputs, again.inputs)
    assert first.value == again.value
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("back_end", ["fatrop", "ipopt"])
def test_running_out_of_iterations_counts_if_the_guess_was_improved(capfd, back_end):
    settings = load_config(robot="kinematic").controller
    model, cost = NominalPrediction("kinematic", settings.dt_s), stage_cost(settings, KINEMATIC)
    problem = transcribe(model, cost, 10, bounds(*settings.u_max))
    solver = NlpSolver(problem, Rollout(model, cost, 10), back_end, most_iterations=1)
    x0, guess = np.array([0.0, 0.5, 0.0]), np.full((10, 2), 0.1)
    plan = solver.solve(x0, guess)
    assert plan.ok == (plan.value < Rollout(model, cost, 10)(x0, guess)[1])
    assert plan.status
    without_guess = solver.solve(np.array([0.0, 0.5, 0.0]), np.full((10, 2), np.nan))
    assert not without_guess.ok
    assert "guess" in without_guess.status
    assert capfd.readouterr() == ("", "")


def test_a_missing_back_end_is_named():
    settings = load_config(robot="kinematic").controller
    model, cost = NominalPrediction("kinematic", settings.dt_s), stage_cost(settings, KINEMATIC)
    problem = transcribe(model, cost, 2, bounds(*settings.u_max))
    with pytest.raises(ConfigError, match="no_such_solver"):
        NlpSolver(problem, Rollout(model, cost, 2), "no_such_solver")
