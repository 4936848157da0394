"""Plans without a steady error."""

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc.disturbance import DisturbanceEstimator, DisturbedPrediction
from koopman_lab.mpc.receding_horizon import receding_horizon, solver_of
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import robot_type
from koopman_lab.studies.closed_loop import closed_loop

ON = "controller.offset_free.enabled=true"
HORIZON = "controller.horizon=20"
SECONDS = 8.0
DRIFT_M = 5e-4
"""Per step; what the wrong model believes of a robot at rest."""


def drifting(config):
    """Return the nominal second-order robot, exact in D8Eul but for a drift along x1."""
    observables, dt_s = dictionary("D8Eul", "dynamic"), config.controller.dt_s
    matrices = []
    for a, d_omega in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)):
        m = np.eye(8)
        m[1, 6] = m[2, 7] = m[3, 5] = dt_s
        m[1, 0] = DRIFT_M
        m[4, 0], m[5, 0] = a * dt_s, d_omega * dt_s
        matrices.append(m)
    inputs = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return KoopmanPrediction(BilinearModel(observables, np.array(matrices), inputs, dt_s, {}))


@pytest.mark.parametrize("solver", ["ddp", "fatrop"])
def test_a_drift_that_is_not_there_no_longer_holds_the_robot_beside_the_goal(solver):
    overrides = [HORIZON, f"controller.solver={solver}", "controller.offset_free.time_constant_s=1"]
    x0, ends = np.array([-0.05, 0.0, 0.0, 0.0, 0.0]), {}
    for extra in ([], [ON]):
        config = load_config(robot="dynamic", overrides=[*overrides, *extra])
        run = closed_loop(config, drifting(config), x0, SECONDS)
        ends[bool(extra)] = abs(run.states[-1, 0])
    assert ends[False] > 5e-3
    assert ends[True] < 0.2 * ends[False]


def test_the_compiled_and_the_written_out_problem_take_the_same_disturbance():
    plans = []
    for compiler in ("true", "false"):
        config = load_config(overrides=[HORIZON, ON, f"controller.use_compiler={compiler}"])
        solver = solver_of(NominalPrediction("kinematic", 0.05), config, "fatrop")
        solver.disturb(np.array([1e-3, -2e-3, 3e-3]))
        x0, guess = np.array([-0.3, 0.1, 0.2]), np.full((20, 2), 0.1)
        plans.append(solver.solve(x0, guess))
        one = robot_type("kinematic").step(x0, guess[0], 0.05) + np.array([1e-3, -2e-3, 3e-3])
        np.testing.assert_allclose(solver.rollout.advance(x0, guess[0]), one, atol=1e-12)
        np.testing.assert_allclose(solver.rollout(x0, guess)[0][1], one, atol=1e-12)
    np.testing.assert_allclose(plans[0].inputs, plans[1].inputs, atol=1e-4)
    assert plans[0].value == pytest.approx(plans[1].value, rel=1e-6)


def test_the_estimate_is_the_mean_error_and_never_more_than_allowed():
    settings = load_config(overrides=[ON]).controller.offset_free
    estimator = DisturbanceEstimator(settings, 0.05)
    small = np.array([1e-4, -2e-4, 3e-4])
    for _ in range(2000):
        # The model in use has the estimate in it already.
        estimator.update(np.zeros(3) + estimator.value, small.copy())
    np.testing.assert_allclose(estimator.value, small, rtol=1e-6)
    for _ in range(2000):
        estimator.update(np.zeros(3), np.array([1.0, 1.0, 2.0]))
    largest = 0.05 * np.array([settings.largest_m_per_s] * 2 + [settings.largest_rad_per_s])
    np.testing.assert_allclose(estimator.value, largest)
    estimator.reset()
    assert not estimator.value.any()


def test_a_whole_turn_is_no_error():
    estimator = DisturbanceEstimator(load_config(overrides=[ON]).controller.offset_free, 0.05)
    estimator.update(np.array([0.0, 0.0, 3.1]), np.array([0.0, 0.0, 3.1 - 2 * np.pi]))
    np.testing.assert_allclose(estimator.value, 0.0, atol=1e-15)


def test_without_reprojection_there_is_no_state_to_correct():
    overrides = [ON, "controller.reprojection=false"]
    config = load_config(robot="dynamic", overrides=overrides)
    with pytest.raises(ConfigError, match=r"offset_free\.enabled needs controller\.reprojection"):
        receding_horizon(drifting(config), config)


def test_everything_but_the_step_is_the_models_own():
    model = NominalPrediction("dynamic", 0.05)
    disturbed = DisturbedPrediction(model)
    assert (disturbed.robot, disturbed.dt_s, disturbed.size) == (model.robot, 0.05, 5)
    assert disturbed.parameters.tolist() == [0.05, 0.0, 0.0, 0.0]
