"""What holds of every kind of robot in the table, and of whatever is added to it."""

import dataclasses
import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.channels import CHANNELS, command_channel
from koopman_lab.config.load import load_config
from koopman_lab.config.presets import Preset
from koopman_lab.robots.table import DEFAULT_ROBOT, ROBOTS, robot_type

KINDS = ROBOTS.names()
every_robot = pytest.mark.parametrize("robot", list(ROBOTS), ids=lambda robot: robot.name)
DT_S = 0.05
FINITE = st.floats(allow_nan=False, allow_infinity=False)
SPEEDS = st.tuples(st.floats(-0.6, 0.6), st.floats(-3.0, 3.0))


def numbers(count, largest=2.0):
    """Return a strategy of arrays (count,)."""
    return st.lists(st.floats(-largest, largest), min_size=count, max_size=count).map(np.array)


def test_each_can_be_used_and_is_found_by_its_name():
    assert [robot.name for robot in ROBOTS] == list(KINDS)
    assert not ROBOTS.faults()
    assert robot_type(DEFAULT_ROBOT) in list(ROBOTS)


@every_robot
def test_names_and_units_are_complete(robot):
    quantities = [*robot.states, *robot.inputs]
    for names in (robot.state_names, robot.input_names):
        assert len(set(names)) == len(names)
    for quantity in quantities:
        assert quantity.name.isidentifier()
        assert set(quantity.name) <= {*string.ascii_letters, *string.digits, "_"}
        assert quantity.column.isidentifier()
    assert set(robot.name) <= {*string.ascii_lowercase, *string.digits, "-", "_"}
    assert robot.title.endswith("robot")


@every_robot
def test_a_description_is_frozen(robot):
    for field in dataclasses.fields(robot):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(robot, field.name, None)


@every_robot
@given(data=st.data())
def test_a_command_carries_the_input_and_nothing_else(robot, data):
    if robot.command is None:
        return
    u = data.draw(st.lists(FINITE, min_size=robot.input_dim, max_size=robot.input_dim))
    message, untouched = robot.command.type(), robot.command.type()
    message.utime = untouched.utime = 7
    message.intent = untouched.intent = message.BEGIN
    robot.command.encode(message, u)
    received = robot.command.type.decode(message.encode())
    assert robot.command.decode(received) == tuple(u)
    robot.command.encode(received, robot.command.decode(untouched))
    assert received.encode() == untouched.encode()


@every_robot
def test_it_is_commanded_on_a_channel_of_its_own_message(robot):
    if robot.command is None:
        return
    channel = command_channel(robot)
    assert channel.suffix == robot.command.suffix
    assert channel.type is robot.command.type
    assert channel.is_command
    assert all(c.type is channel.type for c in CHANNELS if c.suffix == channel.suffix)


@every_robot
@given(data=st.data())
def test_a_step_is_the_flow_of_its_equations(robot, data):
    """The right-hand side is had from short steps, and integrated finely by Runge and Kutta."""
    x, u = data.draw(numbers(robot.state_dim)), data.draw(numbers(robot.input_dim))
    short_s, steps = 1e-4, 20

    def rate(z):
        return (robot.step(z, u, short_s) - robot.step(z, u, -short_s)) / (2.0 * short_s)

    z, h = x, DT_S / steps
    for _ in range(steps):
        k1 = rate(z)
        k2 = rate(z + 0.5 * h * k1)
        k3 = rate(z + 0.5 * h * k2)
        k4 = rate(z + h * k3)
        z = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    assert robot.step(x, u, DT_S) == pytest.approx(z, abs=1e-7)
    assert robot.step(x, u, 0.0) == pytest.approx(x)


@every_robot
@given(data=st.data())
def test_motions_keep_their_shape_when_the_frame_is_moved_and_turned(robot, data):
    x, u = data.draw(numbers(robot.state_dim)), data.draw(numbers(robot.input_dim))
    turn, shift = data.draw(st.floats(-3.0, 3.0)), data.draw(numbers(2))

    def moved(state):
        c, s = np.cos(turn), np.sin(turn)
        plane = np.array([[c, -s], [s, c]]) @ state[:2] + shift
        return np.array([*plane, state[2] + turn, *state[3:]])

    after = robot.step(moved(x), u, DT_S)
    assert after == pytest.approx(moved(robot.step(x, u, DT_S)), abs=1e-9)


@every_robot
@given(data=st.data())
def test_braking_brings_it_to_rest_as_fast_as_the_bounds_allow(robot, data):
    bound, dt_s = st.floats(0.5, 20.0), data.draw(st.sampled_from([0.05, 0.1]))
    u_max = np.array([data.draw(bound) for _ in robot.inputs])
    x = robot.state([0.1, -0.2, 0.3], data.draw(SPEEDS))
    steps = 1 + int(np.ceil(3.0 / (0.5 * dt_s)))
    inputs = robot.braking(x, u_max, dt_s, steps)
    assert inputs.shape == (steps, robot.input_dim)
    assert np.all(np.abs(inputs) <= u_max)
    speeds = [x[list(robot.speeds_at)]]
    for u in inputs:
        x = robot.step(x, u, dt_s)
        speeds.append(x[list(robot.speeds_at)])
    assert np.all(np.diff(np.abs(speeds), axis=0) <= 1e-12)
    assert robot.step(x, np.zeros(robot.input_dim), dt_s) == pytest.approx(x, abs=1e-12)


@every_robot
@given(velocity=SPEEDS, target=SPEEDS)
def test_what_drives_two_wheels_fits_the_equations(robot, velocity, target):
    """Inputs reach the velocities they aim at, and turn the robot as far as the profile says."""
    if robot.drive is None:
        return
    drive = robot.drive
    u = drive.input_towards(velocity, target, DT_S)
    assert drive.velocity_after(velocity, u, DT_S) == pytest.approx(target, abs=1e-12)
    x = robot.step(robot.state([0.0, 0.0, 0.0], velocity), u, DT_S)
    assert x[list(robot.speeds_at)] == pytest.approx(list(target[: len(robot.speeds_at)]))
    assert x[2] == pytest.approx(
        DT_S * drive.mean(velocity, drive.velocity_after(velocity, u, DT_S))[1]
    )
    along = drive.input_along(velocity, target, DT_S)
    x = robot.step(robot.state([0.0, 0.0, 0.0], velocity), along, DT_S)
    assert x[2] == pytest.approx(0.5 * DT_S * (velocity[1] + target[1]), abs=1e-12)
    assert drive.integrates == bool(robot.speeds_at)


@every_robot
@pytest.mark.parametrize("preset", list(Preset))
def test_its_default_configuration_loads_and_fits(robot, preset):
    config = load_config(robot=robot.name, preset=preset)
    assert config.robot.kind == robot.name
    assert len(config.controller.u_max) == robot.input_dim
    assert len(config.sampler.basis_inputs) in robot.basis_counts
    assert (0 in config.sampler.indexed_inputs) >= robot.drifts
    assert max(config.sampler.indexed_inputs) == robot.input_dim
    for cost in ("me", "ce"):
        assert len(config.controller.weights[cost].q) == robot.state_dim
    if robot.drive is not None:
        limits = [getattr(config.motor_loop.limits, name) for name in robot.drive.limits]
        assert np.all(np.array(config.controller.u_max) <= limits)
        assert np.all(np.abs(config.sampler.basis_inputs) <= limits)
        ideal = "linear" if robot.drive.integrates else "instantaneous"
        drives = {Preset.real: None, Preset.ideal: ideal}
        simulated = config.simulation
        drive = None if simulated is None else simulated.plant.motor.drive
        assert drive == drives.get(preset, "dc")


@every_robot
def test_starts_are_poses_on_the_floor_and_times_are_positive(robot):
    area, runs = load_config(robot=robot.name).floor, robot.runs
    for start in (runs.park_start, runs.simulate_start):
        x = robot.state(start)
        assert x.shape == (robot.state_dim,)
        assert tuple(x[:3]) == start
        assert not x[3:].any()
        assert area.x1_m[0] <= start[0] <= area.x1_m[1]
        assert area.x2_m[0] <= start[1] <= area.x2_m[1]
    assert runs.simulate_s > 0.0
    assert min(runs.demo_segments, runs.bench_segments) >= 1
    if runs.random_starts is not None:
        assert all(low < high for low, high in runs.random_starts)
