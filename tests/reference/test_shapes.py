"""The shapes of reference runs, driven by the nominal robot."""

import itertools

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError
from koopman_lab.robots.table import robot_type
from offboard.reference.shapes import Shape, input_sequence, start_pose

BOTH = list(itertools.product(["kinematic", "dynamic"], list(Shape)))


def driven(config, shape):
    """Return the nominal states (T + 1, n) and the inputs (T, 2)."""
    model, inputs = robot_type(config.robot.kind), np.array(input_sequence(config, shape))
    x = np.zeros(model.state_dim)
    x[:3] = start_pose(config, shape)
    states = [x]
    for u in inputs:
        states.append(model.step(states[-1], u, config.controller.dt_s))
    return np.array(states), inputs


@pytest.mark.parametrize(("robot", "shape"), BOTH)
def test_a_shape_stays_in_the_sets_that_models_learn_from(robot, shape):
    config = load_config(robot=robot)
    states, inputs = driven(config, shape)
    v, omega = inputs.T if robot == "kinematic" else states[:, 3:].T
    box = config.sampler.draw_set
    for values, (low, high) in (
        *zip(states[:, :2].T, (box.x1_m, box.x2_m), strict=True),
        *((v, box.v_m_per_s), (omega, box.omega_rad_per_s)),
    ):
        assert low - 1e-9 <= values.min()
        assert values.max() <= high + 1e-9


def test_the_lying_eight_crosses_itself_in_the_middle_and_turns_as_much_left_as_right():
    config = load_config(robot="dynamic")
    states, _ = driven(config, Shape.INFINITY)
    ramp = 20
    lap = states[ramp:-ramp]
    assert np.linalg.norm(lap[-1, :2] - lap[0, :2]) < 1e-3
    assert lap[:, 4].mean() == pytest.approx(0.0, abs=1e-3)
    middle = lap[len(lap) // 2, :2]
    assert np.linalg.norm(middle - lap[0, :2]) < 1e-3
    width, height = np.ptp(lap[:, :2], axis=0)
    assert 1.5 < width / height < 3.0
    assert states[-1, 3:] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_square_closes_turns_left_only_and_lasts_longer():
    config = load_config(robot="dynamic")
    states, _ = driven(config, Shape.SQUARE)
    expected = [*start_pose(config, Shape.SQUARE)[:2], 2.0 * np.pi, 0.0, 0.0]
    assert states[-1] == pytest.approx(expected, abs=1e-9)
    assert states[:, 4].min() > -1e-12
    assert np.ptp(states[:, :2], axis=0) == pytest.approx([0.6, 0.6])
    assert len(states) > len(driven(config, Shape.INFINITY)[0])


@pytest.mark.parametrize("shape", Shape)
def test_no_input_is_beyond_the_configured_accelerations(shape):
    config = load_config(robot="dynamic")
    a, d_omega = np.abs(input_sequence(config, shape)).max(axis=0)
    assert a <= config.reference.acceleration_m_per_s2 + 1e-9
    assert d_omega <= config.reference.turn_acceleration_rad_per_s2 + 1e-9


def test_sides_too_short_for_their_speed_are_refused():
    config = load_config(robot="dynamic", overrides=["reference.square.side_m=0.1"])
    with pytest.raises(ConfigError, match=r"square\.side_m: 0\.1 is too short to reach 0\.2"):
        input_sequence(config, Shape.SQUARE)
