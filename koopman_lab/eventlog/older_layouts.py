"""Messages of types whose layout has changed since: found by fingerprint, read as those of today.

A log outlives the types of its messages. Whoever changes a type that training, validation or a
re-run reads puts the layout it had into :data:`OLDER_LAYOUTS`, and sees to it that the translations
of all older layouts of that type lead to the new one. Logs are read in two ways, by channel
(:func:`~koopman_lab.eventlog.index.index_files`) and event by event
(:func:`~koopman_lab.replay.rotated_log.read_rotated_log`); both give the messages of today, so that
nobody else knows of older layouts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.eventlog.message_blocks import Messages

FINGERPRINT_BYTES = 8
Values = dict[str, Any]
"""Maps a field to a number or a list of numbers."""

_FORMATS = {
    "int8_t": "b",
    "int16_t": "h",
    "int32_t": "i",
    "int64_t": "q",
    "byte": "B",
    "float": "f",
    "double": "d",
    "boolean": "?",
}


class Field(NamedTuple):
    """A field of a message: its LCM type, and its length if it is an array.

    ``length`` is a number, the name of the field before that holds it, or None.
    """

    name: str
    type: str
    length: int | str | None = None


class OlderLayout(NamedTuple):
    """What the messages of a type looked like.

    Attributes
    ----------
    message_type
        The class of the messages of today.
    fingerprint
        What the older messages begin with.
    fields
        In their order on the wire.
    translate
        Maps the values of the older fields to those of the fields of today; fields that it leaves
        out are as in a new message.
    until
        What changed the layout.
    """

    message_type: Any
    fingerprint: bytes
    fields: tuple[Field, ...]
    translate: Callable[[Values], Values]
    until: str


def _with_inputs(values: Values, *u: float) -> Values:
    """Return values with two inputs in the array that holds those of any robot."""
    room = [0.0] * (lcmtypes.mpc_state_t.MOST_INPUTS - len(u))
    return values | {"inputs": len(u), "u": [*u, *room]}


def _two_components(values: Values) -> Values:
    rest = {name: value for name, value in values.items() if name not in ("u1", "u2")}
    return _with_inputs(rest, values["u1"], values["u2"])


def _five_states(values: Values) -> Values:
    states = values["state_in_goal_frame"]
    room = [0.0] * (lcmtypes.mpc_state_t.MOST_STATES - len(states))
    return _with_inputs(values | {"state_in_goal_frame": [*states, *room]}, *values["u"])


def _unchanged(values: Values) -> Values:
    return values


_STAMP = (Field("utime", "int64_t"), Field("sequence", "int64_t"))
_U1_U2 = (Field("u1", "double"), Field("u2", "double"))

OLDER_LAYOUTS = (
    OlderLayout(
        lcmtypes.sampler_state_t,
        bytes.fromhex("7eec3a81ffa04301"),
        (
            *_STAMP,
            Field("phase", "int8_t"),
            Field("segment", "int32_t"),
            Field("basis_index", "int32_t"),
            *_U1_U2,
            Field("segments_done", "int32_t"),
            Field("segments_total", "int32_t"),
            Field("samples", "int64_t"),
            Field("redraws", "int32_t"),
        ),
        _two_components,
        "robots with any number of inputs",
    ),
    OlderLayout(
        lcmtypes.sampler_state_t,
        bytes.fromhex("d55126a2e40e4b07"),
        (
            *_STAMP,
            Field("phase", "int8_t"),
            Field("segment", "int32_t"),
            Field("basis_index", "int32_t"),
            Field("inputs", "int32_t"),
            Field("u", "double", 8),
            Field("segments_done", "int32_t"),
            Field("segments_total", "int32_t"),
            Field("samples", "int64_t"),
            Field("redraws", "int32_t"),
        ),
        lambda values: values,
        "draws given up by reason",
    ),
    OlderLayout(
        lcmtypes.reference_state_t,
        bytes.fromhex("5897e74d8a995ff1"),
        (
            *_STAMP,
            Field("phase", "int8_t"),
            Field("shape", "int8_t"),
            Field("run", "int32_t"),
            Field("step", "int32_t"),
            Field("steps", "int32_t"),
            *_U1_U2,
            Field("runs_done", "int32_t"),
            Field("runs_total", "int32_t"),
            Field("start_x1_m", "double"),
            Field("start_x2_m", "double"),
            Field("start_theta_rad", "double"),
        ),
        _two_components,
        "robots with any number of inputs",
    ),
    OlderLayout(
        lcmtypes.mpc_state_t,
        bytes.fromhex("b07c93e5d3ee19a2"),
        (
            *_STAMP,
            Field("state", "int8_t"),
            Field("goal", "double", 3),
            Field("state_in_goal_frame", "double", 5),
            Field("u", "double", 2),
            Field("value_function", "double"),
            Field("stage_cost", "double"),
            Field("solve_ms", "double"),
            Field("iterations", "int32_t"),
            Field("solved", "boolean"),
            Field("pose_age_us", "int64_t"),
            Field("horizon", "int32_t"),
            Field("predicted_x1_m", "double", "horizon"),
            Field("predicted_x2_m", "double", "horizon"),
        ),
        _five_states,
        "robots with any number of states and inputs",
    ),
    OlderLayout(
        lcmtypes.estop_t,
        bytes.fromhex("357b3519759c0d13"),
        (*_STAMP, Field("engaged", "boolean")),
        _unchanged,
        "releases that name the stop they are meant for",
    ),
    OlderLayout(
        lcmtypes.onboard_status_t,
        bytes.fromhex("633b94c1b681ee04"),
        (
            *_STAMP,
            Field("state", "int8_t"),
            Field("fault", "int8_t"),
            Field("commander", "int32_t"),
            Field("v_setpoint_m_per_s", "double"),
            Field("omega_setpoint_rad_per_s", "double"),
            Field("refused_commander_last", "int32_t"),
            Field("accepted", "int64_t"),
            Field("refused_value", "int64_t"),
            Field("refused_stale", "int64_t"),
            Field("refused_order", "int64_t"),
            Field("refused_commander", "int64_t"),
            Field("refused_type", "int64_t"),
            Field("refused_stopped", "int64_t"),
            Field("battery_v", "double"),
        ),
        _unchanged,
        "releases that name the stop they are meant for",
    ),
)

_BY_FINGERPRINT = {layout.fingerprint: layout for layout in OLDER_LAYOUTS}
_FINGERPRINTS = np.array(list(_BY_FINGERPRINT), f"S{FINGERPRINT_BYTES}")


def in_present_layout(data: bytes) -> bytes:
    """Return a message in the layout of today; bytes that are of no older layout as they are."""
    layout = _BY_FINGERPRINT.get(data[:FINGERPRINT_BYTES])
    if layout is None:
        return data
    try:
        values = decode(layout, data)
    except struct.error:  # too short: no message of any layout
        return data
    message = layout.message_type()
    for name, value in layout.translate(values).items():
        setattr(message, name, value)
    encoded: bytes = message.encode()
    return encoded


def messages_in_present_layout(messages: Messages) -> Messages:
    """Return messages in the layouts of today; the very same ones if none is of an older layout."""
    long_enough = messages.sizes >= FINGERPRINT_BYTES
    heads = messages.heads(long_enough, np.dtype([("fingerprint", _FINGERPRINTS.dtype)]))
    if not np.isin(heads["fingerprint"], _FINGERPRINTS).any():
        return messages
    translated = Messages.joined(map(in_present_layout, messages))
    return Messages(translated.block, translated.starts, translated.stops, messages.arrival_us)


def decode(layout: OlderLayout, data: bytes) -> Values:
    """Return the values in the fields of an older message.

    Raises
    ------
    struct.error
        If it is too short, or a length in it is negative.
    """
    values: Values = {}
    offset = FINGERPRINT_BYTES
    for name, kind, length in layout.fields:
        count = values[length] if isinstance(length, str) else length
        wire = struct.Struct(f">{'' if count is None else count}{_FORMATS[kind]}")
        numbers = wire.unpack_from(data, offset)
        values[name] = numbers[0] if count is None else list(numbers)
        offset += wire.size
    return values
