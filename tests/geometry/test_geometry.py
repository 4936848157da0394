import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from koopman_lab.geometry.planar import (
    Pose,
    body_velocity,
    compose,
    move_along_arc,
    relative_to,
    wheel_speeds,
    wrap_angle,
)

angles = st.floats(-1e3, 1e3)
poses = st.builds(Pose, st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.1, 3.1))


@given(angles)
def test_a_wrapped_angle_lies_in_the_half_open_interval_and_points_the_same_way(theta: float):
    wrapped = wrap_angle(theta)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - theta) == pytest.approx(1.0, abs=1e-12)


def test_the_ends_of_the_interval():
    assert wrap_angle(math.pi) == math.pi
    assert wrap_angle(-math.pi) == math.pi
    assert wrap_angle(np.array([-np.pi, np.pi, 0.0])) == pytest.approx([np.pi, np.pi, 0.0])


@given(st.lists(angles, min_size=1))
def test_arrays_and_floats_agree(thetas: list[float]):
    assert wrap_angle(np.array(thetas)).tolist() == [wrap_angle(t) for t in thetas]


@given(poses, poses)
def test_relative_to_undoes_compose(frame: Pose, pose: Pose):
    back = relative_to(frame, compose(frame, pose))
    assert back.x1 == pytest.approx(pose.x1, abs=1e-9)
    assert back.x2 == pytest.approx(pose.x2, abs=1e-9)
    assert math.cos(back.theta - pose.theta) == pytest.approx(1.0, abs=1e-12)


@given(st.floats(-2, 2), st.floats(-5, 5))
def test_wheel_speeds_and_body_velocity_are_inverse(v: float, omega: float):
    left, right = wheel_speeds(v, omega, 0.03, 0.2)
    assert body_velocity(left, right, 0.03, 0.2) == pytest.approx((v, omega), abs=1e-12)


@pytest.mark.parametrize(("v", "omega"), [(0.3, 0.0), (0.2, -0.4), (0.0, 1.0), (-0.1, 1e-9)])
def test_arcs_solve_the_nominal_kinematics(v: float, omega: float):
    start = (0.3, -0.2, 0.7)
    solution = solve_ivp(
        lambda _, x: [v * np.cos(x[2]), v * np.sin(x[2]), omega],
        (0.0, 2.0),
        start,
        rtol=1e-11,
        atol=1e-12,
    )
    end = move_along_arc(Pose(*start), 2.0 * v, 2.0 * omega)
    assert tuple(end) == pytest.approx(tuple(solution.y[:, -1]), abs=1e-9)
