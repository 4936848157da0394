import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests_support import ideal_run

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose
from onboard.plant.plant import Plant


@pytest.mark.parametrize(("v", "omega"), [(0.2, -0.4), (0.2, 0.6), (0.0, 1.0), (0.4, 0.0)])
def test_ideal_plant_equals_the_nominal_kinematics(v, omega):
    pose, seconds = ideal_run("kinematic", (v, omega), 10.0)
    exact = solve_ivp(
        lambda _, x: [v * np.cos(x[2]), v * np.sin(x[2]), omega],
        (0.0, seconds),
        (0.0, 0.0, 0.0),
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    assert (pose.x1, pose.x2) == pytest.approx((exact[0], exact[1]), abs=1e-9)
    assert math.cos(pose.theta - exact[2]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("a", "d_omega"), [(0.0, 0.0), (0.05, 0.0), (0.05, 0.1), (0.0, -0.25)])
def test_ideal_plant_equals_the_nominal_second_order_model(a, d_omega):
    pose, seconds = ideal_run("dynamic", (a, d_omega), 10.0)
    exact = solve_ivp(
        lambda _, z: [z[3] * np.cos(z[2]), z[3] * np.sin(z[2]), z[4], a, d_omega],
        (0.0, seconds),
        np.zeros(5),
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    assert (pose.x1, pose.x2) == pytest.approx((exact[0], exact[1]), abs=1e-9)
    assert math.cos(pose.theta - exact[2]) == pytest.approx(1.0, abs=1e-12)


def test_geometry_mismatch_bends_a_straight_line():
    plant = Plant(load_config(), np.random.default_rng(0))
    plant.advance(0)
    plant.drive(0.4, 0.4)
    plant.advance(2_000_000)
    assert abs(plant.pose.theta) > 0.01


def test_steps_do_not_change_the_motion():
    poses = []
    for step_us in (1_000, 4_167, 10_000):
        plant = Plant(load_config(), np.random.default_rng(0))
        plant.advance(0)
        plant.drive(0.5, 0.3)
        for t in range(step_us, 1_000_000, step_us):
            plant.advance(t)
        plant.advance(1_000_000)
        poses.append(plant.pose)
    assert poses[1] == pytest.approx(poses[0], abs=2e-4)
    assert poses[2] == pytest.approx(poses[0], abs=2e-4)


def test_placing_by_hand_is_as_exact_as_configured():
    plant = Plant(load_config(robot="dynamic"), np.random.default_rng(0))
    wanted = Pose(-1.1, -0.53, -0.745)
    errors = []
    for _ in range(300):
        plant.place(wanted)
        errors.append(np.subtract(plant.pose, wanted))
    largest = np.abs(errors).max(axis=0)
    assert np.all(largest <= (0.007, 0.007, 0.0873))
    assert np.all(largest > (0.006, 0.006, 0.08))
