"""Keys of older versions, and where they are now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from koopman_lab.config.layer import merge
from koopman_lab.config.yaml_text import Key

ABSENT = object()
"""Stands for no value, since None is one."""

MOVED: dict[Key, Key] = {
    ("radio",): ("simulation", "radio"),
    ("clock", "offset_s"): ("simulation", "clock", "offset_s"),
    ("clock", "drift_ppm"): ("simulation", "clock", "drift_ppm"),
    ("faults",): ("simulation", "faults"),
    ("mocap", "latency_s"): ("simulation", "cameras", "latency_s"),
    ("mocap", "latency_jitter_s"): ("simulation", "cameras", "latency_jitter_s"),
    ("mocap", "position_noise_m"): ("simulation", "cameras", "position_noise_m"),
    ("mocap", "angle_noise_rad"): ("simulation", "cameras", "angle_noise_rad"),
    ("mocap", "marker_offset"): ("simulation", "cameras", "marker_offset"),
    ("mocap", "lost_frame_share"): ("simulation", "cameras", "lost_frame_share"),
    ("mocap", "occlusions_per_s"): ("simulation", "cameras", "occlusions_per_s"),
    ("mocap", "occlusion_s"): ("simulation", "cameras", "occlusion_s"),
    ("plant", "placement"): ("placement",),
    ("plant",): ("simulation", "plant"),
    ("controller", "goal_area"): ("floor",),
}
"""Old key -> new key, of a value or a whole section; a row comes before those that hold it."""


def translate(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a configuration with each at the place where it is now."""
    translated = dict(values)
    for old, new in MOVED.items():
        translated, value = _without(translated, old)
        if value is not ABSENT:
            for part in reversed(new):
                value = {part: value}
            translated = merge(value, translated)
    return translated


def moved(values: Mapping[str, Any]) -> Iterator[tuple[Key, Key]]:
    """Yield the old and the new name of each value, or section, that is not where it is now."""
    for old, new in MOVED.items():
        values, value = _without(values, old)
        if value is not ABSENT:
            yield from _moved_below(value, old, new)


def _moved_below(value: Any, old: Key, new: Key) -> Iterator[tuple[Key, Key]]:
    """Yield what a section holds; a section in it by its own name, unless it holds one key only."""
    if not isinstance(value, Mapping) or not value:
        yield old, new
        return
    for part, inner in value.items():
        below = *old, str(part)
        if isinstance(inner, Mapping) and len(inner) > 1:
            yield below, (*new, str(part))
        else:
            yield from _moved_below(inner, below, (*new, str(part)))


def _without(values: Mapping[str, Any], key: Key) -> tuple[dict[str, Any], Any]:
    """Return the values without one, and that one; a section that is empty then goes as well."""
    rest, first = dict(values), key[0]
    if first not in rest:
        return rest, ABSENT
    if len(key) == 1:
        return rest, rest.pop(first)
    if not isinstance(rest[first], Mapping):
        return rest, ABSENT
    section, value = _without(rest[first], key[1:])
    if value is ABSENT:
        return rest, ABSENT
    if section:
        rest[first] = section
    else:
        del rest[first]
    return rest, value
