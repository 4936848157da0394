"""Nothing that arrives on a channel makes the onboard program raise, or leave its limits."""

import math
import struct

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

COMMANDS = (channels.VELOCITY_CMD, channels.ACCELERATION_CMD)
HEARD = (*COMMANDS, channels.ESTOP, channels.ENCODER, channels.TIME_PONG, channels.FAULT)
CONFIGS = {robot: load_config(robot=robot) for robot in ("kinematic", "dynamic")}
INT64, INT32, INT8 = (st.integers(-(2**n), 2**n - 1) for n in (63, 31, 7))

commands = st.builds(
    struct.pack,
    st.just(">qqibdd"),
    INT64 | st.integers(0, 3_000_000),
    INT64 | st.integers(0, 20),
    INT32 | st.integers(0, 3),
    INT8 | st.integers(0, 2),
    st.floats(width=64),
    st.floats(width=64),
)


@st.composite
def messages(draw):
    """Draw a channel and bytes: any, a cut or changed message, or a well-formed command."""
    channel = draw(st.sampled_from(HEARD))
    if draw(st.booleans()):
        command = draw(st.sampled_from(COMMANDS))
        data = command.type._get_packed_fingerprint() + draw(commands)
        return draw(st.sampled_from(COMMANDS)), data
    data = bytearray(channel.type().encode())
    for at, value in draw(
        st.dictionaries(st.integers(0, len(data) - 1), st.integers(0, 255))
    ).items():
        data[at] = value
    whole = bytes(data)
    return channel, draw(st.sampled_from([whole, whole[: len(whole) // 2], draw(st.binary())]))


class Raw:
    """Bytes in the place of a message."""

    def __init__(self, data):
        self.data = data

    def encode(self):
        return self.data


class Lab:
    """Plant and onboard program in lockstep."""

    def __init__(self, robot):
        self.config = CONFIGS[robot]
        self.onboard = OnboardNode(self.config)
        self.lab = lab_of(self.config, PlantNode(self.config), self.onboard)
        self.lab.run(0.2)


@pytest.mark.parametrize("robot", CONFIGS)
@settings(max_examples=60)
@given(st.lists(messages(), min_size=1, max_size=6))
@example([(channels.VELOCITY_CMD, b"")])
@example([(channels.ACCELERATION_CMD, lcmtypes.acceleration_command_t().encode()[:9])])
def test_no_bytes_make_the_onboard_program_raise_or_leave_its_limits(robot, sent):
    lab = Lab(robot)
    limits, loop = lab.config.motor_loop.limits, lab.onboard.loop
    for channel, data in sent:
        lab.lab.publish(channel, Raw(data))
        lab.lab.run(0.02)
        v, omega = loop.setpoint
        assert math.isfinite(v)
        assert math.isfinite(omega)
        assert abs(v) <= limits.v_m_per_s
        assert abs(omega) <= limits.omega_rad_per_s
    lab.lab.run(0.1)
