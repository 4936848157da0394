"""No number of a configuration can be absurd: neither by a slip nor to switch a guard off."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from koopman_lab.config.load import load_config, parse_config
from koopman_lab.config.presets import Preset
from koopman_lab.config.schema import LabConfig
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.errors import ConfigError

Path = tuple[str | int, ...]

LARGE_IS_MEANT = {
    ("seed",): "any whole number that a generator takes",
    ("logger", "largest_file_bytes"): "1e9 is the default, a gigabyte",
    ("simulation", "plant", "battery", "capacity_ah"): "a supply that never runs empty",
    ("simulation", "clock", "offset_s"): "a board without a clock of its own starts in 1970",
    ("simulation", "faults", 0, "jump_s"): "as far as the board's clock",
}
"""Numbers for which 1e9, and where it can be negative -1e9, is no slip."""
FOR_GOOD = {("simulation", "faults", 0, "duration_s"): "a fault that does not end"}
"""Numbers that may be infinite."""
SWITCHES_OFF = {
    "watchdog_s": 0.5,
    "tracking_timeout_s": 1.0,
    "command_lifetime_s": 2.0,
    "encoder_timeout_s": 0.5,
    "stuck_s": 0.5,
    "stuck_duty": 0.8,
    "command_timeout_s": 1.0,
    "wait_limit_s": 3600.0,
    "phase_time_limit_s": 600.0,
    "pause_limit_s": 600.0,
    "time_limit_s": 3600.0,
}
"""Guards, and the value beyond which they would be none."""


def whole_lab(robot: str) -> dict[str, Any]:
    """Return a configuration in which every number of the schema has a value."""
    values = load_config(robot=robot).model_dump(mode="json")
    values["controller"]["speed_max"] = [1.0, 1.0] if robot == "dynamic" else None
    details = {"kind": "burst_loss", "at_s": 1.0, "duration_s": 1.0, "loss": 0.5}
    values["simulation"]["faults"] = [details]
    return values


def numbers(value: Any, path: Path = ()) -> Iterator[Path]:
    """Yield where numbers are."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers(inner, (*path, key))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from numbers(inner, (*path, index))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def at(values: Any, path: Path) -> Any:
    for part in path:
        values = values[part]
    return values


def changed_at(values: Any, path: Path, number: Any) -> Any:
    """Return the values with another number at a place."""
    if not path:
        return number
    first, rest = path[0], path[1:]
    copy = dict(values) if isinstance(values, Mapping) else list(values)
    copy[first] = changed_at(copy[first], rest, number)
    return copy


def accepts(values: Any) -> bool:
    try:
        LabConfig.model_validate(values)
    except ValueError:
        return False
    return True


PLACES = [(robot, path) for robot in ("kinematic", "dynamic") for path in numbers(whole_lab(robot))]


def test_the_whole_lab_is_a_good_one_and_no_number_is_left_out():
    assert all(accepts(whole_lab(robot)) for robot in ("kinematic", "dynamic"))
    names = {part for _, path in PLACES for part in path if isinstance(part, str)}
    for section in sections(LabConfig):
        for name, field in section.model_fields.items():
            numeric = "float" in str(field.annotation) or "int" in str(field.annotation)
            assert not numeric or name in names | {"battery_v", "jump_s"}, (section, name)


def sections(section: type) -> Iterator[type]:
    from typing import get_args

    yield section
    for field in section.model_fields.values():
        inner = [field.annotation, *get_args(field.annotation)]
        for kind in inner:
            if isinstance(kind, type) and hasattr(kind, "model_fields"):
                yield from sections(kind)


@pytest.mark.parametrize(("robot", "path"), PLACES, ids=lambda part: str(part))
def test_every_number_refuses_what_is_none_and_what_is_absurd(robot, path):
    values = whole_lab(robot)
    assert accepts(changed_at(values, path, at(values, path)))
    assert not accepts(changed_at(values, path, math.nan))
    if path not in FOR_GOOD:
        assert not accepts(changed_at(values, path, math.inf))
        assert path in LARGE_IS_MEANT or not accepts(changed_at(values, path, 1e9))
    assert not accepts(changed_at(values, path, -math.inf))
    assert path in LARGE_IS_MEANT or not accepts(changed_at(values, path, -1e9))
    # What may be 0 may be next to nothing; a whole number may not.
    if not accepts(changed_at(values, path, 0)):
        assert not accepts(changed_at(values, path, 1e-9))


def test_the_exceptions_are_there():
    places = {path for _, path in PLACES}
    jump = PlannedFault.model_validate({"kind": "clock_jump", "at_s": 0.0, "jump_s": 1e9})
    assert jump.jump_s == 1e9
    assert set(LARGE_IS_MEANT) | set(FOR_GOOD) <= places | {("simulation", "faults", 0, "jump_s")}


@pytest.mark.parametrize("number", [math.nan, math.inf, 1e10, -1e10])
def test_a_clock_cannot_be_off_by_more_than_clocks_are(number):
    with pytest.raises(ValueError, match="jump_s"):
        Fault.model_validate({"kind": "camera_clock", "jump_s": number})


@pytest.mark.parametrize("name", SWITCHES_OFF)
def test_no_guard_can_be_set_so_that_it_is_none(name):
    most = SWITCHES_OFF[name]
    for robot, path in PLACES:
        if path[-1] == name:
            values = whole_lab(robot)
            assert accepts(changed_at(values, path, most))
            assert not accepts(changed_at(values, path, most * 1.01))


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "motor_loop.watchdog_s=1e9",
            "motor_loop.watchdog_s: 1e+09 is more than 0.5 s: a robot at full speed would roll "
            "0.3 m blind",
        ),
        (
            "motor_loop.rate_hz=0.001",
            "motor_loop.rate_hz: 0.001 is less than 20 Hz: watchdog, stop and health are judged",
        ),
        (
            "motor_loop.limits.v_m_per_s=1e6",
            "motor_loop.limits.v_m_per_s: 1e+06 is more than 3 m/s",
        ),
        (
            "motor_loop.limits.a_m_per_s2=1000",
            "motor_loop.limits.a_m_per_s2: 1000 is more than 50: no wheel holds the floor so hard",
        ),
        ("controller.tracking_timeout_s=1e9", "is more than 1 s: a robot at full speed would roll"),
        ("floor.x1_m=[-1e9, 1]", "floor.x1_m.0: -1e+09 is less than -100 m: no cameras see so far"),
    ],
)
def test_the_message_says_what_would_be_so_bad(override, said):
    with pytest.raises(ConfigError) as error:
        load_config(overrides=[override])
    assert said in str(error.value)
    assert str(error.value).startswith(f"--set {override}: ")
    assert "\n" not in str(error.value)


def test_motors_that_are_there_brake_no_harder_than_wheels_hold():
    assert load_config(preset=Preset.ideal).motor_loop.limits.a_m_per_s2 == 1e6
    with pytest.raises(ConfigError, match="a_m_per_s2: 1000 is more than 50"):
        load_config(preset=Preset.real, overrides=["motor_loop.limits.a_m_per_s2=1000"])


def test_a_record_is_held_to_the_same_bounds():
    with pytest.raises(ConfigError, match=r"record:3: motor_loop.watchdog_s: 9 is more than 0.5 s"):
        parse_config("robot: {kind: dynamic}\nmotor_loop:\n  watchdog_s: 9\n", "record")
