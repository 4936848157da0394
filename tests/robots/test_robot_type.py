"""What every description of a robot keeps to, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from koopman_lab.errors import ConfigError
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import MOST_INPUTS, MOST_STATES, Quantity
from koopman_lab.robots.table import ROBOTS


@pytest.mark.parametrize("field", ["states", "inputs"])
@pytest.mark.parametrize("count", [0, 1 + max(MOST_INPUTS, MOST_STATES)])
def test_more_states_or_inputs_than_messages_hold_are_refused_in_words(field, count):
    pose = KINEMATIC.states
    quantities = (*pose, *(Quantity(f"q{k}", "") for k in range(count)))[:count]
    with pytest.raises(ConfigError, match=f"robot 'kinematic' has {count} {field}.*room for"):
        replace(KINEMATIC, **{field: quantities})


def test_a_state_that_does_not_begin_with_the_pose_is_refused():
    with pytest.raises(ConfigError, match="begin with theta, x2, x1, expected the pose x1, x2"):
        replace(KINEMATIC, states=KINEMATIC.states[::-1])


def test_columns_bear_their_units():
    assert [state.column for state in DYNAMIC.states] == [
        *("x1_m", "x2_m", "theta_rad"),
        *("v_m_per_s", "omega_rad_per_s"),
    ]
    assert [u.column for u in DYNAMIC.inputs] == ["a_m_per_s2", "d_omega_rad_per_s2"]
    assert Quantity("gear", "").column == "gear"


@pytest.mark.parametrize("robot", list(ROBOTS), ids=lambda robot: robot.name)
def test_a_turn_on_the_spot_turns_and_stays_in_place(robot):
    if robot.turn is None:
        return
    rest, u = robot.turn(0.7, 0.0)
    x = robot.step(np.array([0.1, 0.2, 0.3, *rest]), u, 0.5)
    assert x[:3] == pytest.approx([0.1, 0.2, 0.3 + 0.5 * 0.7])


@pytest.mark.parametrize("robot", list(ROBOTS), ids=lambda robot: robot.name)
def test_braking_ends_at_rest_and_keeps_the_bounds(robot):
    u_max = np.full(robot.input_dim, 2.0)
    x = np.zeros(robot.state_dim)
    x[list(robot.speeds_at)] = 0.3
    inputs = robot.braking(x, u_max, 0.1, 5)
    assert inputs.shape == (5, robot.input_dim)
    assert np.all(np.abs(inputs) <= u_max)
    for u in inputs:
        x = robot.step(x, u, 0.1)
    standing = robot.step(x, np.zeros(robot.input_dim), 0.1)
    assert standing == pytest.approx(x, abs=1e-12)
