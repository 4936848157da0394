from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
import yaml

from koopman_lab.config.load import dump_config, load_config, parse_config
from koopman_lab.config.presets import Preset
from koopman_lab.errors import ConfigError


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("preset", list(Preset))
def test_a_dumped_configuration_reads_back_unchanged(robot, preset):
    config = load_config(robot=robot, preset=preset)
    assert parse_config(dump_config(config), "dump") == config


def test_harsh_is_three_times_as_far_from_ideal_as_the_lab():
    lab, ideal, harsh = (load_config(preset=preset) for preset in ("lab", "ideal", "harsh"))
    exact = {"viscous_friction_n_m_s_per_rad": 0.0, "coulomb_friction_n_m": 0.0}
    exact |= {"breakaway_friction_n_m": 0.0, "resistance_ohm": 0.0, "centre_of_mass_ahead_m": 0.0}
    for part, names in {
        "simulation.plant.motor": ("gain", *list(exact)[:3]),
        "simulation.plant.battery": ("resistance_ohm",),
        "simulation.plant.body": (
            *("wheel_radius_factor", "track_width_factor", "slip_angle_rad_s2_per_m"),
            "centre_of_mass_ahead_m",
        ),
        "simulation.cameras": (
            *("latency_s", "latency_jitter_s", "position_noise_m", "angle_noise_rad"),
            *("marker_offset", "lost_frame_share"),
        ),
    }.items():
        of_lab, of_ideal, of_harsh = (attrgetter(part)(c) for c in (lab, ideal, harsh))
        for name in names:
            zero = np.array(exact.get(name, getattr(of_ideal, name)))
            assert np.array(getattr(of_harsh, name)) - zero == pytest.approx(
                3.0 * (np.array(getattr(of_lab, name)) - zero)
            )
    lab_counts = lab.motor_loop.encoder_counts_per_rev
    assert harsh.motor_loop.encoder_counts_per_rev == lab_counts / 3


def test_the_papers_numbers():
    kinematic, dynamic = load_config(robot="kinematic"), load_config(robot="dynamic")
    assert kinematic.sampler.indexed_inputs == {1: (0.2, -0.4), 2: (0.2, 0.6)}
    assert dynamic.sampler.indexed_inputs == {0: (0.0, 0.0), 1: (0.2, 0.0), 2: (0.0, 0.5)}
    assert (kinematic.controller.horizon, dynamic.controller.horizon) == (60, 50)
    assert (kinematic.model.dictionary, dynamic.model.dictionary) == ("D5t", "D8Eul")
    for config in (kinematic, dynamic):
        assert config.mocap.rate_hz == 240.0
        assert config.motor_loop.rate_hz == 100.0
        assert config.motor_loop.wheel_state_window_s == 0.05
        assert config.controller.dt_s == config.processing.dt_s == 0.05
        assert config.processing.smoothing_window == 40


def test_later_layers_win(tmp_path: Path):
    file = tmp_path / "lab.yaml"
    file.write_text("robot: {kind: dynamic, name: R7}\ncontroller:\n  horizon: 30\n")
    config = load_config(file, overrides=["controller.horizon=40"])
    assert config.robot.name == "R7"
    assert config.controller.horizon == 40
    assert config.model.dictionary == "D8Eul"


def message(tmp_path: Path, text: str, **kwargs) -> str:
    file = tmp_path / "lab.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_config(file, **kwargs)
    return str(error.value).replace(str(file), "lab.yaml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "controller:\n  horizont: 40\n",
            "lab.yaml:2: controller.horizont: unknown key; did you mean controller.horizon?",
        ),
        (
            "horizon: 40\n",
            "lab.yaml:1: horizon: unknown key; did you mean controller.horizon?",
        ),
        (
            "controller:\n  horizon: 0\n",
            "lab.yaml:2: controller.horizon: input should be greater than or equal to 1, found 0",
        ),
        (
            "sampler:\n  draw_set:\n    x1_m: [2, 1]\n",
            "lab.yaml:3: sampler.draw_set.x1_m: expected [low, high] with low < high, found [2, 1]",
        ),
        ("robot: {name: r 1}\n", "lab.yaml:1: robot.name: string should match pattern"),
        ("mocap: {rate_hz: .nan}\n", "lab.yaml:1: mocap.rate_hz: input should be a finite number"),
        ("mocap: [1\n", "lab.yaml:2: not valid YAML"),
        ("just words\n", "lab.yaml:1: expected sections such as 'controller:'"),
        (
            "simulation:\n  radio:\n    to_robot: {loss: 1.5}\n",
            "lab.yaml:3: simulation.radio.to_robot.loss: input should be less than or equal to 1",
        ),
        (
            "controller: {weights: {me: {q: [1, 2], r: [1, 1]}}}\n",
            "lab.yaml:1: controller.weights.me.q: the kinematic robot has 3 states (x1, x2, "
            "theta), found 2 weights",
        ),
        (
            "controller:\n  weights: {ds: {r: [1]}}\n",
            "lab.yaml:2: controller.weights.ds.r: the kinematic robot has 2 inputs (v, omega), "
            "found 1",
        ),
        (
            "controller:\n  u_max: [1, 2, 3]\n",
            "lab.yaml:2: controller.u_max: the kinematic robot has 2 inputs (v, omega), found 3",
        ),
        (
            "controller:\n  speed_max: [1, 2]\n",
            "lab.yaml:2: controller.speed_max: the state of the kinematic robot holds no velocity",
        ),
        (
            "robot: {kind: dynamic}\ncontroller: {speed_max: [1]}\n",
            "lab.yaml:2: controller.speed_max: the dynamic robot has 2 velocities (v, omega), "
            "found 1",
        ),
        (
            "sampler:\n  basis_inputs: [[0, 1]]\n",
            "lab.yaml:2: sampler.basis_inputs: expected u_1, u_2 or u_0, u_1, u_2 of the kinematic "
            "robot, found 1 inputs",
        ),
        (
            "robot: {kind: dynamic}\nsampler:\n  basis_inputs: [[0, 1], [1, 0]]\n",
            "lab.yaml:3: sampler.basis_inputs: expected u_0, u_1, u_2 of the dynamic robot, found "
            "2 inputs",
        ),
        (
            "sampler:\n  basis_inputs:\n    - [0, 1]\n    - [1]\n",
            "lab.yaml:4: sampler.basis_inputs.1: the kinematic robot has 2 inputs (v, omega), "
            "found 1",
        ),
        (
            "robot:\n  kind: dynamik\n",
            "lab.yaml:2: robot.kind: unknown robot 'dynamik', known: kinematic, dynamic; did you "
            "mean dynamic?",
        ),
        ("robot: {kind: 3}\n", "lab.yaml:1: robot.kind: input should be a valid string, found 3"),
        ("presets: {}\n", "lab.yaml:1: presets: unknown key"),
        (
            "controller:\n  cost: mee\n",
            "lab.yaml:2: controller.cost: input should be 'me', 'ce' or 'ds', found 'mee'",
        ),
        (
            "controller:\n  weights:\n    mee: {q: [1, 2, 3], r: [1, 1]}\n",
            "lab.yaml:3: controller.weights.mee: input should be 'me', 'ce' or 'ds', found 'mee'",
        ),
        (
            "simulation: {clock: {drift_ppm: 200}}\n",
            "simulation.clock.drift_ppm 200 is beyond clock.largest_drift_ppm 100",
        ),
        (
            "simulation:\n  camera: {}\n",
            "lab.yaml:2: simulation.camera: unknown key; did you mean simulation.cameras?",
        ),
    ],
)
def test_messages_name_file_line_key_and_remedy(tmp_path, text, said):
    assert said in message(tmp_path, text)


def test_a_record_of_an_unknown_robot_lists_the_known_ones():
    with pytest.raises(ConfigError, match=r"record:2: robot\.kind: unknown .*: kinematic, dynamic"):
        parse_config("robot:\n  kind: unicycle\n", "record")


def test_an_unknown_robot_of_a_script_lists_the_known_ones():
    with pytest.raises(ConfigError, match=r"^unknown .*: kinematic, dynamic$"):
        load_config(robot="unicycle")


def test_robot_of_the_file_and_of_the_command_must_agree(tmp_path):
    said = message(tmp_path, "robot:\n  kind: dynamic\n", robot="kinematic")
    assert said == "lab.yaml:2: robot.kind is dynamic, but --robot says kinematic; drop one"


@pytest.mark.parametrize("override", ["controller.horizon", "=3", ".=3", "controller.horizon=[1"])
def test_malformed_overrides(override):
    with pytest.raises(ConfigError, match="--set"):
        load_config(overrides=[override])


def test_missing_file(tmp_path):
    with pytest.raises(ConfigError, match="no such configuration file"):
        load_config(tmp_path / "none.yaml")


def test_every_default_says_where_it_comes_from():
    """Each value line of the default files carries a comment, or stands below one that does."""
    folder = Path(load_config.__code__.co_filename).parent / "defaults"
    for file in ("base.yaml", "kinematic.yaml", "dynamic.yaml"):
        text = (folder / file).read_text()
        assert yaml.safe_load(text)
        explained_indent = None
        for line in text.splitlines():
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            indent = len(line) - len(line.lstrip())
            if explained_indent is not None and indent > explained_indent:
                continue
            explained_indent = indent if "#" in line else None
            section = line.rstrip().endswith(":")
            assert "#" in line or section, f"{file}: no source for: {line.strip()}"


def test_a_record_of_an_older_version_takes_defaults_for_what_it_does_not_say():
    config = load_config(robot="dynamic", overrides=["controller.horizon=17"])
    said = yaml.safe_load(dump_config(config))
    del (
        said["simulation"]["radio"],
        said["controller"]["use_compiler"],
        said["robot"]["track_width_m"],
    )
    assert parse_config(yaml.safe_dump(said), "record") == config


def test_a_record_that_does_not_say_the_robots_kind_is_none():
    with pytest.raises(ConfigError, match="record"):
        parse_config("seed: 1", "record")
