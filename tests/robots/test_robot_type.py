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


def test_axes_bear_symbols_and_units():
    labels = [quantity.label for quantity in (*DYNAMIC.states, *DYNAMIC.inputs)]
    assert labels[2:] == ["θ (rad)", "v (m/s)", "ω (rad/s)", "a (m/s²)", "dω (rad/s²)"]
    assert Quantity("gear", "").label == "gear"


@pytest.mark.parametrize("robot", list(ROBOTS), ids=lambda robot: robot.name)
def test_a_turn_on_the_spot_turns_and_stays_in_place(robot):
    if robot.turn is None:
        return
    rest, u = robot.turn(0.7, 0.0)
    x = robot.step(np.array([0.1, 0.2, 0.3, *rest]), u, 0.5)
    assert x[:3] == pytest.approx([0.1, 0.2, 0.3 + 0.5 * 0.7])


def test_a_command_message_has_a_field_for_each_input():
    command = replace(KINEMATIC.command, fields=("v_m_per_s",))
    with pytest.raises(ConfigError, match=r"robot 'kinematic' has 2 inputs, .* carries 1; name a"):
        replace(KINEMATIC, command=command)


def test_two_driven_wheels_take_two_inputs():
    three = (*KINEMATIC.inputs, Quantity("lift", "m/s"))
    with pytest.raises(ConfigError, match="has 3 inputs, a robot on two driven wheels has 2"):
        replace(KINEMATIC, inputs=three, command=None)
