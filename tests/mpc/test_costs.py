"""The mixed-exponents cost against its closed form and its geometry."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.mpc.costs import MixedExponents, stage_cost

KINEMATIC = MixedExponents((1.0, 5.0, 0.1), (0.5, 0.05))
DYNAMIC = MixedExponents((1.0, 5.0, 0.1, 0.3, 0.2), (0.01, 0.02))
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


@given(z=st.tuples(*[FINITE] * 5), u=st.tuples(FINITE, FINITE))
def test_symbols_and_numbers_cost_the_same(z, u):
    x_symbol, u_symbol = ca.SX.sym("x", 5), ca.SX.sym("u", 2)
    function = ca.Function("cost", [x_symbol, u_symbol], [DYNAMIC(x_symbol, u_symbol)])
    assert float(function(z, u)) == pytest.approx(DYNAMIC(z, u), rel=1e-14)


def test_a_whole_trajectory_is_costed_at_once():
    rng = np.random.default_rng(0)
    states, inputs = rng.normal(size=(5, 7)), rng.normal(size=(2, 7))
    each = [DYNAMIC(states[:, k], inputs[:, k]) for k in range(7)]
    np.testing.assert_allclose(DYNAMIC(states, inputs), each, rtol=1e-14)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_configuration_names_the_weights(robot):
    settings = load_config(robot=robot).controller
    cost, weights = stage_cost(settings), settings.weights["me"]
    for index, weight in enumerate(weights.q):
        unit = np.eye(len(weights.q))[index]
        assert cost(unit, [0.0, 0.0]) == weight
    for index, weight in enumerate(weights.r):
        assert cost(np.zeros(len(weights.q)), np.eye(2)[index]) == weight
