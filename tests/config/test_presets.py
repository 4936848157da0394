"""Preset real: nothing simulated, and a robot that cannot be told to leave its limits."""

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.config.presets import Preset
from koopman_lab.errors import ConfigError
from offboard.terminal import options

ROBOTS = ("kinematic", "dynamic")


def test_the_choices_of_every_command_are_the_presets():
    assert options.PresetName is Preset
    assert [preset.value for preset in Preset] == ["real", "lab", "harsh", "ideal"]


@pytest.mark.parametrize("robot", ROBOTS)
def test_only_with_preset_real_nothing_is_simulated(robot):
    for preset in Preset:
        config = load_config(robot=robot, preset=preset)
        assert (config.simulation is None) == (preset is Preset.real)
    with pytest.raises(ConfigError, match=r"klab run onboard.*--preset lab"):
        load_config(robot=robot, preset="real").require_simulation()


def test_a_part_of_what_is_simulated_on_a_real_robot_is_refused_in_one_line(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("seed: 3\nsimulation:\n  clock: {offset_s: 1}\n")
    with pytest.raises(ConfigError) as error:
        load_config(file, preset="real")
    assert str(error.value) == (
        f"{file}:2: simulation: set in part, but this preset simulates nothing; drop it, "
        "or take --preset lab"
    )
    assert load_config(file).simulation.clock.offset_s == 1.0


@pytest.mark.parametrize("robot", ROBOTS)
def test_with_preset_real_nothing_asks_for_more_than_the_limits(robot):
    real, lab = (load_config(robot=robot, preset=preset) for preset in ("real", "lab"))
    limits, sampler, controller = real.motor_loop.limits, real.sampler, real.controller
    speeds = np.array([limits.v_m_per_s, limits.omega_rad_per_s])
    accelerations = np.array([limits.a_m_per_s2, limits.d_omega_rad_per_s2])
    usual = lab.motor_loop.limits
    assert np.all(speeds < [usual.v_m_per_s, usual.omega_rad_per_s])
    assert np.all(accelerations < [usual.a_m_per_s2, usual.d_omega_rad_per_s2])
    of_inputs = accelerations if robot == "dynamic" else speeds
    for u in (*sampler.basis_inputs, controller.u_max):
        assert np.all(np.abs(u) <= of_inputs)
    for box in (sampler.draw_set, sampler.admissible_set):
        if robot == "dynamic" or box is sampler.admissible_set:
            ranges = np.abs([box.v_m_per_s, box.omega_rad_per_s])
            assert np.all(ranges.max(axis=1) <= speeds)
    if controller.speed_max is not None:
        assert np.all(np.array(controller.speed_max) <= speeds)
    drive = [sampler.drive_speed_m_per_s, sampler.turn_speed_rad_per_s]
    ramps = [sampler.acceleration_m_per_s2, sampler.turn_acceleration_rad_per_s2]
    assert np.all(np.array(drive) <= speeds)
    assert np.all(np.array(ramps) <= accelerations)
    shapes = real.reference
    assert max(shapes.infinity.speed_m_per_s, shapes.square.speed_m_per_s) <= limits.v_m_per_s
    assert shapes.square.turn_speed_rad_per_s <= limits.omega_rad_per_s
