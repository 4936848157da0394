"""Prediction models: the nominal equations, and a surrogate with exactly known matrices."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from prediction_models import exact_d5t

from koopman_lab.config.load import load_config
from koopman_lab.errors import ModelError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc.receding_horizon import receding_horizon
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.stage_costs import MixedExponents, QuadraticInObservables
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.predictors.table import load_prediction
from koopman_lab.robots.table import robot_type

CONTROLLER = load_config(robot="kinematic").controller
ANGLE = st.floats(-9.0, 9.0)
SPEED = st.floats(-0.5, 0.5)


def as_function(model):
    x, u = ca.SX.sym("x", model.state_dim), ca.SX.sym("u", 2)
    step = ca.Function("step", [x, u], [model.step(x, u, ca.DM(model.parameters))])
    return lambda state, command: np.asarray(step(state, command)).ravel()


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_nominal_prediction_is_the_nominal_model(robot):
    model, prediction = robot_type(robot), NominalPrediction(robot, 0.05)
    assert (prediction.robot, prediction.state_dim) == (model, model.state_dim)
    step, rng = as_function(prediction), np.random.default_rng(0)
    for _ in range(20):
        x, u = rng.normal(size=model.state_dim), rng.normal(size=2)
        np.testing.assert_allclose(step(x, u), model.step(x, u, 0.05), atol=1e-14)


@given(theta=ANGLE, v=SPEED, omega=st.floats(-2.0, 2.0))
def test_the_surrogate_predicts_in_symbols_what_it_predicts_in_numbers(theta, v, omega):
    model = exact_d5t()
    x, u = np.array([0.3, -0.2, theta]), np.array([v, omega])
    predicted = as_function(KoopmanPrediction(model))(x, u)
    np.testing.assert_allclose(predicted, model.step(x, u), atol=1e-12)
    # The angle goes on from where it was, also beyond a half turn.
    assert predicted[2] == pytest.approx(theta + 0.05 * omega, abs=1e-3)


@pytest.mark.parametrize("name", ["D5t", "D8Eul", "D13t"])
def test_without_reprojection_the_observables_are_propagated_as_they_are(name):
    kind = "kinematic" if name == "D5t" else "dynamic"
    observables, rng = dictionary(name, kind), np.random.default_rng(0)
    size, horizon = observables.size, 12
    matrices = np.eye(size) + 0.02 * rng.normal(size=(3, size, size))
    matrices[:, 0] = np.eye(size)[0]
    model = BilinearModel(
        observables, matrices, np.array([[0, 0], [0.2, -0.4], [0.2, 0.6]]), 0.05, {}
    )
    n = observables.state_dim
    x0, inputs = 0.5 * rng.normal(size=n), 0.3 * rng.normal(size=(horizon, 2))
    weights = rng.uniform(size=size), rng.uniform(size=2)
    cost = QuadraticInObservables(observables, *weights)
    found = Rollout(LiftedPrediction(model), cost, horizon).trajectory(x0, inputs)
    predicted = model.predict(x0, inputs, reproject=False)
    np.testing.assert_allclose(found.states, predicted, atol=1e-12)
    psi = [observables.lift(x0)]
    for u in inputs:
        psi.append(model.matrix(u) @ psi[-1])
    np.testing.assert_allclose(found.propagated, psi, atol=1e-12)
    with_rest = np.vstack([inputs, np.zeros(2)])
    expected = sum(cost.of_observables(p, u) for p, u in zip(psi, with_rest, strict=True))
    assert found.value == pytest.approx(expected, rel=1e-12)
    of_states = MixedExponents(tuple(weights[0][:n]), tuple(weights[1]), model.robot.sideways)
    value = Rollout(LiftedPrediction(model), of_states, horizon)(x0, inputs)[1]
    assert value == pytest.approx(np.sum(of_states(predicted.T, with_rest.T)), rel=1e-12)


def test_a_model_file_becomes_a_prediction(tmp_path):
    exact_d5t().save(tmp_path / "model.npz")
    prediction = load_prediction(tmp_path / "model.npz", CONTROLLER)
    assert (prediction.robot.name, prediction.state_dim, prediction.dt_s) == ("kinematic", 3, 0.05)
    nominal = CONTROLLER.model_copy(update={"predict": "nominal"})
    assert isinstance(load_prediction(tmp_path / "model.npz", nominal), NominalPrediction)
    with pytest.raises(ModelError, match=r"absent\.npz"):
        load_prediction(tmp_path / "absent.npz", CONTROLLER)


@pytest.mark.parametrize("reprojection", ["true", "false"])
def test_the_nominal_robot_parks_with_a_surrogate(reprojection):
    overrides = [f"controller.reprojection={reprojection}"]
    config = load_config(robot="kinematic", overrides=overrides)
    horizon = receding_horizon(KoopmanPrediction(exact_d5t()), config)
    model, x = robot_type("kinematic"), np.array([0.0, 0.5, 0.0])
    for _ in range(160):
        decision = horizon.step(x)
        assert decision.solved
        x = model.step(x, decision.u, 0.05)
    assert abs(x[0]) <= 0.03
    assert abs(x[1]) <= 0.01
    assert abs(x[2]) <= np.deg2rad(5.0)
