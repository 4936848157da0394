"""Settings in Python are values like those of files and overrides, and stand above them."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import dump_config, load_config, with_settings
from koopman_lab.config.presets import Preset
from koopman_lab.errors import ConfigError

WRONG = {
    "an unknown key": ({"controller": {"horizn": 3}}, "settings: controller.horizn: unknown key"),
    "an unknown section": ({"controler": {"horizon": 3}}, "settings: controler: unknown key"),
    "another type": ({"controller": {"horizon": "many"}}, "settings: controller.horizon: "),
    "out of bounds": ({"controller": {"horizon": 0}}, "settings: controller.horizon: "),
    "no section": ({"controller": 3}, "settings: controller: "),
    "another number of values": (
        {"controller": {"u_max": np.ones(3)}},
        "settings: controller.u_max: the kinematic robot has 2 inputs (v, omega), found 3",
    ),
}


@given(
    st.integers(1, 1000),
    st.lists(st.floats(1e-6, 1e6), min_size=2, max_size=2),
    st.lists(st.floats(0.0, 1e6), min_size=3, max_size=3),
)
def test_numbers_in_python_mean_what_they_mean_in_yaml(horizon, u_max, q):
    plain = {"horizon": horizon, "u_max": u_max, "weights": {"me": {"q": q, "r": [1.0, 2.0]}}}
    numpy = {
        **{"horizon": np.int64(horizon), "u_max": np.array(u_max)},
        "weights": {"me": {"q": tuple(map(np.float64, q)), "r": np.array([1, 2])}},
    }
    expected = load_config(
        overrides=[f"controller={yaml.safe_dump(plain, default_flow_style=True)}"]
    )
    for settings in (plain, numpy):
        assert load_config(settings={"controller": settings}) == expected
        assert with_settings(load_config(), {"controller": settings}) == expected
        assert expected.controller.u_max == tuple(u_max)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("preset", list(Preset))
def test_no_settings_change_nothing(robot, preset):
    config = load_config(robot=robot, preset=preset)
    assert with_settings(config, {}) == config
    assert load_config(robot=robot, preset=preset, settings={}) == config


def test_settings_stand_above_files_and_overrides(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("seed: 4\ncontroller: {horizon: 20, cost: ce}\n")
    chosen = load_config(
        str(file),
        overrides=["controller.horizon=30", "robot.name=R7"],
        settings={"controller": {"horizon": 40}},
    )
    assert (chosen.seed, chosen.robot.name) == (4, "R7")
    assert (chosen.controller.horizon, chosen.controller.cost) == (40, "ce")


@pytest.mark.parametrize(("settings", "said"), WRONG.values(), ids=WRONG)
def test_what_is_not_allowed_is_said_with_its_key(settings, said):
    config = load_config()
    for refuse in (lambda s: load_config(settings=s), lambda s: with_settings(config, s)):
        with pytest.raises(ConfigError) as refused:
            refuse(settings)
        assert str(refused.value).startswith(said)
    assert dump_config(config) == dump_config(load_config())
