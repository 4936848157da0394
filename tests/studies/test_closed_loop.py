"""The closed loop on the nominal equations."""

import numpy as np
import pytest
from prediction_models import exact_d5t

from koopman_lab.config.load import load_config
from koopman_lab.mpc.receding_horizon import solver_of
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.closed_loop import as_rows, closed_loop, columns, row, x2_last_mm

X0 = np.array([-0.2, 0.1, 0.3])
SHORT = ["controller.horizon=20"]


def test_a_run_is_that_of_the_nominal_equations_and_of_nothing_else():
    config, model = load_config(robot="kinematic", overrides=SHORT), exact_d5t()
    run = closed_loop(config, KoopmanPrediction(model), X0, 1.5)
    assert run.states.shape == (31, 3)
    assert run.time_s[-1] == pytest.approx(1.5)
    robot = robot_type("kinematic")
    np.testing.assert_array_equal(run.states[0], X0)
    np.testing.assert_array_equal(run.states[1:], robot.step(run.states[:-1], run.inputs, 0.05))
    assert run.unsolved == 0
    assert run.values[-1] < 0.2 * run.values[0]
    solver = solver_of(KoopmanPrediction(model), config)
    for _ in range(2):
        again = closed_loop(config, KoopmanPrediction(model), X0, 1.5, solver)
        np.testing.assert_array_equal(again.states, run.states)
    rows = as_rows(run, robot)
    assert {len(row) for row in rows} == {len(columns(robot))}
    assert len(rows) == 30
    assert x2_last_mm(run) == 1e3 * np.abs(run.states[10:, 1]).max()


def test_the_quadratic_cost_stays_away_from_the_goal_where_mixed_exponents_do_not():
    """Parallel parking, the paper's section 4, with the same weights."""
    weights = "{q: [1.0, 10.0, 0.1], r: [0.5, 0.05]}"
    away_mm = {}
    for cost in ("me", "ce"):
        overrides = [f"controller.cost={cost}", f"controller.weights.{cost}={weights}"]
        overrides += ["controller.dt_s=0.1", "controller.horizon=30"]
        config = load_config(robot="kinematic", overrides=overrides)
        x0 = np.array([0.0, 0.3, 0.0])
        run = closed_loop(config, NominalPrediction("kinematic", 0.1), x0, 8.0)
        away_mm[cost] = x2_last_mm(run)
    assert away_mm["me"] < 0.1
    assert away_mm["ce"] > 1.0


def test_columns_are_those_of_the_robots_states_and_inputs():
    pose, speeds = ("time_s", "x1_m", "x2_m", "theta_rad"), ("v_m_per_s", "omega_rad_per_s")
    assert columns(robot_type("kinematic")) == (*pose, *speeds, "u1", "u2", "value")
    assert columns(robot_type("dynamic")) == (*pose, *speeds, "u1", "u2", "value")
    x, u = (1.0, 2.0, 3.0, 0.4, 0.5), (6.0, 7.0)
    assert row(robot_type("dynamic"), 0.1, x, u, 8.0) == [0.1, *x, *u, 8.0]
    for no_speed in (None, 0.0):
        line = row(robot_type("kinematic"), 0.1, x[:3], u, 8.0, no_speed)
        assert line == [0.1, *x[:3], no_speed, no_speed, *u, 8.0]
