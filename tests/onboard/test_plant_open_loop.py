"""How far the nominal equations are off over a second; the paper's section 5.3 names the order."""

import math

import numpy as np
import pytest
from motor_bench import Bench

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose, Velocity, move_along_arc

DT_S, STEPS, SPLIT = 0.05, 20, 10


def inputs(rng, count):
    """Return accelerations that keep v in [0, 0.4] m/s and omega in [-1, 1] rad/s."""
    v, omega, us = 0.0, 0.0, []
    for k in range(count):
        if k % 10 == 0:
            a, d_omega = rng.uniform(-0.4, 0.4), rng.uniform(-1.0, 1.0)
        a = a if 0.0 <= v + a * DT_S <= 0.4 else -a
        d_omega = d_omega if abs(omega + d_omega * DT_S) <= 1.0 else -d_omega
        us.append((a, d_omega))
        v, omega = v + a * DT_S, omega + d_omega * DT_S
    return us


def predicted(pose, velocity, us):
    """Integrate the paper's second-order equations; inside a split, v and omega are their means."""
    (v, omega), h = velocity, DT_S / SPLIT
    for a, d_omega in us:
        for _ in range(SPLIT):
            pose = move_along_arc(pose, h * (v + 0.5 * a * h), h * (omega + 0.5 * d_omega * h))
            v, omega = v + a * h, omega + d_omega * h
    return pose


def largest_errors(preset):
    """Return the largest error of position (m) and orientation (rad) over 1 s in open loop."""
    bench = Bench(load_config(robot="dynamic", preset=preset))
    us, states = inputs(np.random.default_rng(0), 300), []
    for u in us:
        states.append((bench.plant.pose, Velocity(*bench.plant.body_velocity())))
        assert bench.command(u) is None
        for _ in range(round(DT_S * 100)):
            bench.tick()
    errors = []
    for start in range(len(us) - STEPS):
        found = predicted(*states[start], us[start : start + STEPS])
        true: Pose = states[start + STEPS][0]
        turned = math.remainder(found.theta - true.theta, 2.0 * math.pi)
        errors.append((math.hypot(found.x1 - true.x1, found.x2 - true.x2), abs(turned)))
    return np.max(errors, axis=0)


def test_the_lab_robot_is_off_by_a_centimetre_and_a_few_degrees():
    position, angle = largest_errors("lab")
    assert 0.003 < position < 0.05
    assert math.radians(1.0) < angle < math.radians(8.0)


def test_the_ideal_robot_is_off_by_the_one_tick_that_a_command_takes():
    # Where the input turns round, a tick makes 8 mm/s and 0.02 rad/s of difference, over 1 s.
    position, angle = largest_errors("ideal")
    assert position < 0.009
    assert angle < 0.021


def test_the_harsh_robot_is_worse():
    assert np.all(largest_errors("harsh") > 2.0 * largest_errors("lab"))


@pytest.mark.parametrize("preset", ["ideal", "lab", "harsh"])
def test_the_same_seed_moves_the_same_way(preset):
    assert np.array_equal(largest_errors(preset), largest_errors(preset))
