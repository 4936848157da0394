"""The stage costs against their closed forms, and the geometry of the mixed exponents."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.cost_table import COSTS, Cost
from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc.configured_cost import stage_cost, stage_weights
from koopman_lab.mpc.stage_costs import MixedExponents, Quadratic, QuadraticInObservables
from koopman_lab.robots.table import robot_type

KINEMATIC = MixedExponents((1.0, 5.0, 0.1), (0.5, 0.05), robot_type("kinematic").sideways)
D5T = dictionary("D5t", "kinematic")
CE = Quadratic((1.0, 5.0, 0.1), (0.5, 0.05))
DS = QuadraticInObservables(D5T, (9.0, 1.0, 5.0, 0.1, 0.2), (0.5, 0.05))
DYNAMIC = MixedExponents((1.0, 5.0, 0.1, 0.3, 0.2), (0.01, 0.02), robot_type("dynamic").sideways)
FINITE = st.floats(-3.0, 3.0)


def test_each_term_has_the_weight_and_exponent_of_the_paper():
    assert KINEMATIC([2, 0, 0], [0, 0]) == 1.0 * 16
    assert KINEMATIC([0, 2, 0], [0, 0]) == 5.0 * 4
    assert KINEMATIC([0, 0, 2], [0, 0]) == 0.1 * 16
    assert KINEMATIC([0, 0, 0], [2, 0]) == 0.5 * 16
    assert KINEMATIC([0, 0, 0], [0, 2]) == 0.05 * 16
    assert DYNAMIC([0, 0, 0, 2, 0], [0, 0]) == 0.3 * 16
    assert DYNAMIC([0, 0, 0, 0, 2], [0, 0]) == 0.2 * 16
    assert DYNAMIC([0, 0, 0, 0, 0], [0, 2]) == 0.02 * 16


@given(x=st.tuples(FINITE, FINITE, FINITE), u=st.tuples(FINITE, FINITE), s=st.floats(0.1, 3.0))
def test_dilation_of_the_sub_riemannian_geometry_scales_the_cost_by_its_fourth_power(x, u, s):
    dilated = KINEMATIC((s * x[0], s**2 * x[1], s * x[2]), (s * u[0], s * u[1]))
    assert dilated == pytest.approx(s**4 * KINEMATIC(x, u), rel=1e-9, abs=1e-300)


@given(x=st.tuples(FINITE, FINITE, FINITE), u=st.tuples(FINITE, FINITE))
def test_quadratic_costs_have_their_closed_forms(x, u):
    of_u = 0.5 * u[0] ** 2 + 0.05 * u[1] ** 2
    expected = x[0] ** 2 + 5.0 * x[1] ** 2 + 0.1 * x[2] ** 2 + of_u
    assert CE(x, u) == pytest.approx(expected, rel=1e-12, abs=1e-300)
    # psi_d = (1, 0, 0, 1, 0), so that the constant observable costs nothing.
    turned = 0.1 * (np.cos(x[2]) - 1.0) ** 2 + 0.2 * np.sin(x[2]) ** 2
    expected = x[0] ** 2 + 5.0 * x[1] ** 2 + turned + of_u
    assert DS(x, u) == pytest.approx(expected, rel=1e-12, abs=1e-300)
    assert DS.of_observables(D5T.lift(x), u) == pytest.approx(expected, rel=1e-12, abs=1e-300)


@given(z=st.tuples(*[FINITE] * 5), u=st.tuples(FINITE, FINITE))
def test_symbols_and_numbers_cost_the_same(z, u):
    for cost, x in ((DYNAMIC, z), (CE, z[:3]), (DS, z[:3])):
        x_symbol, u_symbol = ca.SX.sym("x", len(x)), ca.SX.sym("u", 2)
        function = ca.Function("cost", [x_symbol, u_symbol], [cost(x_symbol, u_symbol)])
        assert float(function(x, u)) == pytest.approx(cost(x, u), rel=1e-14, abs=1e-300)


def test_a_weight_of_the_observables_is_for_all_or_each_has_its_own():
    def settings(q):
        overrides = ["controller.cost=ds", f"controller.weights.ds.q={q}"]
        return load_config(robot="kinematic", overrides=overrides).controller

    assert stage_cost(settings([2.0]), robot_type("kinematic"), D5T).q == (2.0,) * 5
    assert stage_cost(settings([1, 2, 3, 4, 5]), robot_type("kinematic"), D5T).q == (
        1.0,
        2.0,
        3.0,
        4.0,
        5.0,
    )
    with pytest.raises(ConfigError, match=r"has 2 weights.*D5t has 5.*cos\(theta\)"):
        stage_cost(settings([1.0, 2.0]), robot_type("kinematic"), D5T)
    with pytest.raises(ConfigError, match="choose me or ce"):
        stage_cost(settings([1.0]), robot_type("kinematic"))


def test_a_whole_trajectory_is_costed_at_once():
    rng = np.random.default_rng(0)
    states, inputs = rng.normal(size=(5, 7)), rng.normal(size=(2, 7))
    for cost in (DYNAMIC, CE, DS):
        each = [cost(states[:, k], inputs[:, k]) for k in range(7)]
        np.testing.assert_allclose(cost(states, inputs), each, rtol=1e-14)


@pytest.mark.parametrize("name", ["me", "ce"])
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_configuration_names_the_weights(robot, name):
    settings = load_config(robot=robot, overrides=[f"controller.cost={name}"]).controller
    cost, weights = stage_cost(settings, robot_type(robot)), settings.weights[name]
    for index, weight in enumerate(weights.q):
        unit = np.eye(len(weights.q))[index]
        assert cost(unit, [0.0, 0.0]) == weight
    for index, weight in enumerate(weights.r):
        assert cost(np.zeros(len(weights.q)), np.eye(2)[index]) == weight


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("name", COSTS.names())
def test_every_cost_of_the_table_is_zero_at_the_goal_alone_and_the_same_in_symbols(name, robot):
    config = load_config(robot=robot, overrides=[f"controller.cost={name}"])
    observables = dictionary(config.model.dictionary, robot)
    of, rng = robot_type(robot), np.random.default_rng(0)
    cost = stage_cost(config.controller, of, observables)
    names, q, r = stage_weights(config.controller, of, observables)
    assert len(cost.parameters) == len(q) + len(r) == len(names) + of.input_dim
    assert cost(np.zeros(of.state_dim), np.zeros(of.input_dim)) == 0.0
    x_symbol, u_symbol = ca.SX.sym("x", of.state_dim), ca.SX.sym("u", of.input_dim)
    weights = ca.SX.sym("weights", len(cost.parameters))
    function = ca.Function(
        "cost", [x_symbol, u_symbol, weights], [cost(x_symbol, u_symbol, weights)]
    )
    for _ in range(20):
        x, u = rng.normal(size=of.state_dim), rng.normal(size=of.input_dim)
        assert cost(x, u) > 0.0
        assert float(function(x, u, cost.parameters)) == pytest.approx(cost(x, u), rel=1e-12)


@pytest.fixture
def eager():
    """Add a cost that has weights of its own."""
    row = Cost(
        "eager",
        lambda q, r, robot, observables: Quadratic(q, r),  # noqa: ARG005
        weights=lambda robot: ((2.0,) * robot.state_dim, (3.0,) * robot.input_dim),
    )
    COSTS.register(row.name, row)
    yield
    COSTS.unregister(row.name)


@pytest.mark.usefixtures("eager")
def test_a_cost_of_others_brings_weights_that_the_configuration_may_replace():
    asked = ["controller.cost=eager"]
    settings = load_config(robot="dynamic", overrides=asked).controller
    cost = stage_cost(settings, robot_type("dynamic"))
    assert cost.parameters.tolist() == [2.0] * 5 + [3.0] * 2
    asked.append("controller.weights.eager={q: [1, 2, 3], r: [4, 5]}")
    settings = load_config(robot="kinematic", overrides=asked).controller
    assert stage_cost(settings, robot_type("kinematic")).parameters.tolist() == [1, 2, 3, 4, 5]
    # How many it takes it says where it is built; the configuration does not ask it.
    settings = load_config(robot="dynamic", overrides=asked).controller
    with pytest.raises(ConfigError, match=r"weights\.eager\.q has 3 weights, the dynamic robot h"):
        stage_cost(settings, robot_type("dynamic"))


def test_a_cost_without_weights_says_where_to_put_them():
    settings = load_config(robot="kinematic").controller
    settings = settings.model_copy(update={"weights": {}})
    with pytest.raises(ConfigError, match=r"add controller\.weights\.me with q and r"):
        stage_cost(settings, robot_type("kinematic"))
