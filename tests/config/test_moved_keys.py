"""Keys of older versions: refused where a person writes them, understood in what a run left."""

from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from old_keys import as_it_was, leaves, nested, old_dump

from koopman_lab.config.load import dump_config, load_config, parse_config, read_record
from koopman_lab.config.moved_keys import MOVED, moved, translate
from koopman_lab.config.presets import Preset
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import ConfigError

REFERENCE = Path(__file__).parents[1] / "data" / "older"


LAB = leaves(load_config(robot="dynamic").model_dump(mode="json"))


OLD = {as_it_was(key): value for key, value in LAB.items()}
"""The configuration of preset lab in the keys of the version that recorded tests/data/reference."""


def test_no_old_key_has_a_meaning_today():
    assert not {key for old in MOVED for key in LAB if key[: len(old)] == old}
    assert len(OLD) == len(LAB)


@given(st.sets(st.sampled_from(sorted(OLD))))
def test_translated_values_are_all_there_at_their_present_keys(keys):
    old = nested({key: OLD[key] for key in keys})
    present = {key: LAB[key] for key in LAB if as_it_was(key) in keys}
    assert leaves(translate(old)) == present
    assert translate(translate(old)) == translate(old)


@given(st.sets(st.sampled_from(sorted(OLD)), min_size=1))
def test_each_old_key_or_its_section_is_named_with_its_present_name(keys):
    named = dict(moved(nested({key: OLD[key] for key in keys})))
    for key in keys:
        present = next(new for new in LAB if as_it_was(new) == key)
        if present == key:
            continue
        (old,) = [old for old in named if key[: len(old)] == old]
        assert present == named[old] + key[len(old) :]
    assert all(any(key[: len(old)] == old for key in keys) for old in named)


def test_a_record_in_old_keys_says_the_same():
    config = load_config(robot="dynamic")
    assert leaves(yaml.safe_load(old_dump(config))) == OLD
    assert parse_config(old_dump(config), "record") == config


@pytest.mark.parametrize("preset", list(Preset))
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_record_of_today_says_the_same(tmp_path, robot, preset):
    """Nothing simulated is a value, too, which no default replaces."""
    config = load_config(robot=robot, preset=preset)
    file = tmp_path / "config.yaml"
    file.write_text(dump_config(config))
    assert read_record(file) == load_config(file) == config


@pytest.mark.parametrize("log", ["calibration", "park"])
def test_the_logs_of_the_version_before_are_understood(log):
    config = SessionLog(REFERENCE / f"{log}.lcm").config()
    expected = load_config(overrides=["mocap.rate_hz=120"])
    for section in ("mocap", "clock", "placement", "simulation"):
        assert getattr(config, section) == getattr(expected, section)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("radio:\n  to_robot:\n    loss: 0.1\n", ["3: radio.to_robot.loss: is now simulation."]),
        ("faults: []\n", ["1: faults: is now simulation.faults"]),
        (
            "clock:\n  ping_rate_hz: 2\n  offset_s: 1\n",
            ["3: clock.offset_s: is now simulation.clock.offset_s"],
        ),
        (
            "mocap: {rate_hz: 100}\nplant:\n  placement: {angle_rad: 0}\n  motor:\n"
            "    gain: [1, 1]\n    drive: dc\n",
            [
                "3: plant.placement.angle_rad: is now placement.angle_rad",
                "4: plant.motor: is now simulation.plant.motor",
            ],
        ),
    ],
)
def test_a_file_with_old_keys_is_refused_line_by_line(tmp_path, text, lines):
    file = tmp_path / "lab.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_config(file)
    told = str(error.value).splitlines()
    assert len(told) == len(lines)
    for line, words in zip(told, lines, strict=True):
        assert line.startswith(f"{file}:{words}")


@pytest.mark.parametrize("key", sorted(key for key in OLD if key not in LAB))
def test_an_override_of_any_old_key_names_the_new_one(key):
    dotted = ".".join(key)
    new = next(".".join(present) for present in LAB if as_it_was(present) == key)
    with pytest.raises(ConfigError) as error:
        load_config(overrides=[f"{dotted}=1"])
    assert str(error.value) == f"--set {dotted}=1: {dotted}: is now {new}"
