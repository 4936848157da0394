"""The drivetrain against closed forms and against equations written in other coordinates."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError
from onboard.plant.drivetrain import Drivetrain
from onboard.plant.plant import Plant

SIMPLE = (
    "simulation.plant.motor.gain=[1.0, 1.0]",
    "simulation.plant.motor.coulomb_friction_n_m=[0.0, 0.0]",
    "simulation.plant.motor.breakaway_friction_n_m=[0.0, 0.0]",
    "simulation.plant.battery.resistance_ohm=0.0",
    "simulation.plant.battery.capacity_ah=1.0e+9",
    "simulation.plant.body.centre_of_mass_ahead_m=0.0",
    "simulation.plant.body.wheel_radius_factor=[1.0, 1.0]",
    "simulation.plant.body.track_width_factor=1.0",
)


def turn(drivetrain, duties, seconds, step_us=5000):
    drivetrain.drive(*duties)
    for _ in range(round(seconds * 1e6 / step_us)):
        drivetrain.advance(step_us)
    return drivetrain.left_rad_per_s, drivetrain.right_rad_per_s


def speeds_of_newton_and_euler(config, duties, seconds):
    """Integrate v and omega of the body with the forces at both rims; friction as while turning."""
    motor, body, battery = (
        config.simulation.plant.motor,
        config.simulation.plant.body,
        config.simulation.plant.battery,
    )
    radii = config.robot.wheel_radius_m * np.array(body.wheel_radius_factor)
    track = config.robot.track_width_m * body.track_width_factor
    k = motor.torque_constant_n_m_per_a * motor.gear_ratio
    turning = body.wheel_inertia_kg_m2 + motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
    share = np.array(duties) * motor.gain
    full = battery.empty_v + battery.state_of_charge * (battery.full_v - battery.empty_v)
    offset = body.mass_kg * body.centre_of_mass_ahead_m

    def wheels(v, omega):
        return np.array([v - 0.5 * track * omega, v + 0.5 * track * omega]) / radii

    def rates(_, z):
        v, omega = z
        w = wheels(v, omega)
        voltage = full
        for _ in range(50):  # the droop and the currents that make it, until they agree
            currents = (share * voltage - k * w) / motor.resistance_ohm
            load = share @ currents + battery.board_current_a
            voltage = full - battery.resistance_ohm * load
        torque = k * currents - motor.viscous_friction_n_m_s_per_rad * w
        torque = torque - np.sign(share) * motor.coulomb_friction_n_m
        # Rim forces: what the motors give, less what speeds up wheels and rotors.
        left, right = torque / radii
        spin = turning / radii**2
        mass = np.array(
            [
                [body.mass_kg + spin.sum(), 0.5 * track * (spin[1] - spin[0])],
                [
                    0.5 * track * (spin[1] - spin[0]),
                    body.inertia_kg_m2 + 0.25 * track**2 * spin.sum(),
                ],
            ]
        )
        forces = [
            left + right + offset * omega**2,
            0.5 * track * (right - left) - offset * omega * v,
        ]
        return np.linalg.solve(mass, forces)

    end = solve_ivp(rates, (0.0, seconds), (0.0, 0.0), rtol=1e-10, atol=1e-12).y[:, -1]
    return wheels(*end)


@pytest.mark.parametrize("preset", ["lab", "harsh"])
@pytest.mark.parametrize("duties", [(0.5, 0.3), (-0.4, 0.6), (1.0, 1.0)])
@pytest.mark.parametrize("seconds", [0.05, 1.0])
def test_speeds_are_those_of_newton_and_euler(preset, duties, seconds):
    config = load_config(preset=preset, overrides=["simulation.plant.battery.capacity_ah=1.0e+9"])
    found = turn(Drivetrain(config), duties, seconds)
    assert found == pytest.approx(speeds_of_newton_and_euler(config, duties, seconds), abs=5e-3)


def test_a_smaller_step_comes_closer_with_the_square():
    config = load_config(overrides=["simulation.plant.battery.capacity_ah=1.0e+9"])
    exact = speeds_of_newton_and_euler(config, (0.8, 0.5), 0.05)
    errors = [
        np.abs(turn(Drivetrain(config), (0.8, 0.5), 0.05, step_us) - exact).max()
        for step_us in (10_000, 5_000, 2_500)
    ]
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


@pytest.mark.parametrize("step_us", [1_000, 4_167, 50_000])
def test_without_friction_and_droop_it_is_the_exact_lag_of_a_motor(step_us):
    config = load_config(overrides=SIMPLE)
    motor, body, r = (
        config.simulation.plant.motor,
        config.simulation.plant.body,
        config.robot.wheel_radius_m,
    )
    k = motor.torque_constant_n_m_per_a * motor.gear_ratio
    damping = k**2 / motor.resistance_ohm + motor.viscous_friction_n_m_s_per_rad
    turning = body.wheel_inertia_kg_m2 + motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
    drivetrain = Drivetrain(config)
    final = 0.5 * drivetrain.battery_v() * k / motor.resistance_ohm / damping
    track = config.robot.track_width_m
    for duties, mass in (
        ((0.5, 0.5), turning + 0.5 * r**2 * body.mass_kg),
        ((-0.5, 0.5), turning + 2.0 * (r / track) ** 2 * body.inertia_kg_m2),
    ):
        drivetrain.halt()
        _, right = turn(drivetrain, duties, step_us * 1e-6 * 3, step_us)
        lag = mass / damping
        assert right == pytest.approx(final * (1 - math.exp(-3e-6 * step_us / lag)), rel=1e-9)


def test_the_lab_robot_has_the_lag_and_the_speed_that_feed_forward_believes_in():
    config = load_config()
    _, right = turn(Drivetrain(load_config(overrides=SIMPLE)), (1.0, 1.0), 1.0)
    nominal = config.motor_loop.pid.feed_forward_full_duty_rad_per_s
    assert right == pytest.approx(nominal, rel=0.03)
    _, early = turn(Drivetrain(load_config(overrides=SIMPLE)), (1.0, 1.0), 0.05)
    assert early / right == pytest.approx(1.0 - math.exp(-1.0), rel=0.03)


def test_friction_holds_a_wheel_at_rest_and_stops_a_moving_one():
    config = load_config()
    motor = config.simulation.plant.motor
    k = motor.torque_constant_n_m_per_a * motor.gear_ratio
    drivetrain = Drivetrain(config)
    per_duty = k / motor.resistance_ohm * drivetrain.battery_v()
    held = [
        0.98 * limit / (per_duty * gain)
        for limit, gain in zip(motor.breakaway_friction_n_m, motor.gain, strict=True)
    ]
    assert turn(drivetrain, held, 1.0) == (0.0, 0.0)
    assert min(turn(drivetrain, [1.1 * duty for duty in held], 1.0)) > 0.0
    # Sliding friction is lower: what did not start the wheels keeps them going.
    assert min(turn(drivetrain, held, 1.0)) > 0.0
    assert turn(drivetrain, (0.0, 0.0), 1.0) == (0.0, 0.0)


def test_a_strong_wheel_may_turn_while_friction_holds_the_other():
    left, right = turn(Drivetrain(load_config()), (0.0, 0.3), 1.0)
    assert left == 0.0
    assert right > 5.0


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), max_size=8))
def test_without_duty_the_energy_never_grows(duties):
    config = load_config(preset="harsh")
    drivetrain = Drivetrain(config)
    for pair in duties:
        turn(drivetrain, pair, 0.05)
    drivetrain.drive(0.0, 0.0)
    energy = math.inf
    for _ in range(100):
        w = np.array([drivetrain.left_rad_per_s, drivetrain.right_rad_per_s])
        mass = np.array(
            [
                [drivetrain._mass_left, drivetrain._mass_cross],
                [drivetrain._mass_cross, drivetrain._mass_right],
            ]
        )
        assert w @ mass @ w <= energy
        energy = w @ mass @ w
        drivetrain.advance(5_000)
    assert energy == 0.0


def test_the_battery_droops_under_load_and_runs_down():
    config = load_config()
    battery = config.simulation.plant.battery
    drivetrain = Drivetrain(config)
    idle_v = drivetrain.battery_v()
    open_v = battery.empty_v + battery.state_of_charge * (battery.full_v - battery.empty_v)
    assert idle_v == pytest.approx(open_v - battery.resistance_ohm * battery.board_current_a)
    drivetrain.drive(1.0, 1.0)
    stalled_a = (
        sum(g**2 for g in config.simulation.plant.motor.gain)
        / config.simulation.plant.motor.resistance_ohm
    )
    drop = battery.resistance_ohm * stalled_a * drivetrain.battery_v()
    assert drivetrain.battery_v() == pytest.approx(idle_v - drop, rel=1e-9)
    turn(drivetrain, (0.0, 0.0), 36.0)
    drivetrain.drive(0.0, 0.0)
    used_ah = battery.board_current_a * 0.01
    left = battery.state_of_charge - used_ah / battery.capacity_ah
    assert drivetrain.state_of_charge == pytest.approx(left, rel=1e-9)


def test_a_curve_drifts_outward_by_the_slip_angle():
    def radius(slip):
        config = load_config(
            overrides=[*SIMPLE, f"simulation.plant.body.slip_angle_rad_s2_per_m={slip}"]
        )
        plant = Plant(config, np.random.default_rng(0))
        plant.advance(0)
        plant.drive(0.3, 0.5)
        plant.advance(1_000_000)
        (x1, x2, theta), (v, omega) = plant.pose, plant.body_velocity()
        plant.advance(1_000_100)
        course = math.atan2(plant.pose.x2 - x2, plant.pose.x1 - x1)
        return course - theta - 0.5e-4 * omega, v * omega

    assert radius(0.0)[0] == pytest.approx(0.0, abs=1e-9)
    drift, centripetal = radius(0.02)
    assert drift == pytest.approx(-0.02 * centripetal, rel=1e-6)


def test_a_body_whose_mass_lies_too_far_off_cannot_be():
    with pytest.raises(ConfigError, match=r"the centre of mass alone makes 0\.04"):
        load_config(overrides=["simulation.plant.body.centre_of_mass_ahead_m=0.2"])
