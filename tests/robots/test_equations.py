import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from koopman_lab.geometry.planar import Pose, move_along_arc
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC


@given(
    st.floats(-3, 3),
    st.floats(-0.6, 0.6),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-20, 20),
    st.sampled_from([0.05, 0.1]),
)
def test_second_order_step_solves_the_equations(theta, v, omega, a, d_omega, dt_s):
    z0 = np.array([0.3, -0.2, theta, v, omega])
    exact = solve_ivp(
        lambda _, z: [z[3] * np.cos(z[2]), z[3] * np.sin(z[2]), z[4], a, d_omega],
        (0.0, dt_s),
        z0,
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    assert DYNAMIC.step(z0, [a, d_omega], dt_s) == pytest.approx(exact, abs=1e-11)


@given(st.floats(-3, 3), st.floats(-0.6, 0.6), st.floats(-3, 3))
def test_kinematic_step_is_the_arc(theta, v, omega):
    after = KINEMATIC.step(np.array([0.1, 0.2, theta]), [v, omega], 0.1)
    arc = move_along_arc(Pose(0.1, 0.2, theta), 0.1 * v, 0.1 * omega)
    assert after == pytest.approx(tuple(arc), abs=1e-12)


@pytest.mark.parametrize("model", [KINEMATIC, DYNAMIC])
def test_arrays_and_symbols_agree(model):
    rng = np.random.default_rng(0)
    states, inputs = rng.normal(size=(20, model.state_dim)), rng.normal(size=(20, 2))
    x, u = ca.SX.sym("x", model.state_dim), ca.SX.sym("u", 2)
    successor = model.components(ca.vertsplit(x), ca.vertsplit(u), 0.05, ca)
    function = ca.Function("step", [x, u], [ca.vertcat(*successor)])
    expected = model.step(states, inputs, 0.05)
    for row, state, value in zip(expected, states, inputs, strict=True):
        assert np.array(function(state, value)).ravel() == pytest.approx(row, abs=1e-14)
