"""Messages whose layout has changed since, read as those of today."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from older_messages import encode
from random_messages import fields, has_fixed_size, messages, values

import lcmtypes
from koopman_lab.eventlog.index import index_files
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.eventlog.older_layouts import (
    OLDER_LAYOUTS,
    Field,
    OlderLayout,
    decode,
    in_present_layout,
    messages_in_present_layout,
)
from koopman_lab.replay.rotated_log import read_rotated_log

REFERENCE = Path(__file__).parents[1] / "data" / "older"
LAYOUTS = pytest.mark.parametrize(
    "layout", OLDER_LAYOUTS, ids=lambda of: f"{of.message_type.__name__} {of.fingerprint.hex()}"
)
MASK = (1 << 64) - 1


def lcm_fingerprint(layout):
    """Return the fingerprint that lcm-gen gives fields (name, type, length), all of plain types."""

    def update(value, number):
        signed = value - (1 << 64) if value >> 63 else value
        return (((value << 8) ^ (signed >> 55)) + number) & MASK

    def with_text(value, text):
        for character in (len(text), *text.encode()):
            value = update(value, character)
        return value

    value = 0x12345678
    for name, kind, length in layout:
        value = with_text(with_text(value, name), kind)
        value = update(value, 0 if length is None else 1)
        if length is not None:
            # LCM counts where the length stands, and its text as it is written.
            value = with_text(update(value, int(isinstance(length, str))), str(length))
    rotated = ((value << 1) & MASK) + (value >> 63)
    return rotated.to_bytes(8, "big")


@LAYOUTS
def test_the_fingerprint_is_that_of_the_fields(layout):
    assert lcm_fingerprint(layout.fields) == layout.fingerprint


def test_that_rule_gives_the_fingerprints_of_today():
    for kind in (
        lcmtypes.mocap_pose_t,
        lcmtypes.encoder_t,
        lcmtypes.goal_t,
        lcmtypes.wheel_state_t,
    ):
        assert lcm_fingerprint(fields(kind)) == kind._get_packed_fingerprint()


def two_inputs(old):
    return {"inputs": 2, "u": (old["u1"], old["u2"], *[0.0] * 6)} if "u1" in old else {}


EXPECTED = {
    lcmtypes.sampler_state_t: lambda old: {"redraws_by_reason": (0,) * 16, **two_inputs(old)},
    lcmtypes.reference_state_t: two_inputs,
    lcmtypes.mpc_state_t: lambda old: {
        "inputs": 2,
        "u": (*old["u"], *[0.0] * 6),
        "state_in_goal_frame": (*old["state_in_goal_frame"], *[0.0] * 11),
    },
    lcmtypes.estop_t: lambda _: {"stop_number": 0},
    lcmtypes.onboard_status_t: lambda _: {"stop_number": 0, "refused_release": 0},
}
"""What becomes of fields that are not there any more, or longer."""


@LAYOUTS
@given(st.data())
def test_every_value_of_an_older_message_is_in_that_of_today(layout, data):
    old = data.draw(values(layout.fields))
    message = layout.message_type.decode(in_present_layout(encode(layout, old)))
    changed = EXPECTED[layout.message_type](old)
    for name in layout.message_type.__slots__:
        expected = changed[name] if name in changed else old[name]
        assert getattr(message, name) == expected
    assert set(old) - {"u1", "u2"} <= set(layout.message_type.__slots__)


@pytest.mark.parametrize(
    "kind", [t for t in EXPECTED if has_fixed_size(t)] + [lcmtypes.mocap_pose_t]
)
@given(st.data())
def test_messages_of_today_stay_as_they_are(kind, data):
    wire = data.draw(messages(kind)).encode()
    assert in_present_layout(wire) is wire
    block = Messages.joined([wire, b"", b"short", wire])
    assert messages_in_present_layout(block) is block


@LAYOUTS
def test_an_older_message_that_was_cut_stays_what_it_is(layout):
    numbers = {
        name: 0 if length is None else (0,) * (0 if isinstance(length, str) else length)
        for name, _, length in layout.fields
    }
    whole = encode(layout, numbers)
    assert in_present_layout(whole) != whole
    for size in range(8, len(whole)):
        assert in_present_layout(whole[:size]) == whole[:size]


def test_a_negative_length_is_none():
    layout = next(of for of in OLDER_LAYOUTS if of.message_type is lcmtypes.mpc_state_t)
    numbers = {
        name: 0 if length is None else (0,) * (0 if isinstance(length, str) else length)
        for name, _, length in layout.fields
    }
    message = encode(layout, numbers | {"horizon": -3})
    assert in_present_layout(message) == message


@pytest.mark.parametrize(("name", "suffix"), [("calibration", "SAMPLER"), ("park", "MPC")])
def test_logs_of_older_versions_are_read_either_way(name, suffix):
    path, channel = REFERENCE / f"{name}.lcm", f"R1_{suffix}_STATE"
    kind = getattr(lcmtypes, f"{suffix.lower()}_state_t")
    one_by_one = [event.data for event in read_rotated_log(path) if event.channel == channel]
    at_once = list(index_files([path], salvage=False)[channel])
    assert one_by_one == at_once
    decoded = [kind.decode(data) for data in at_once]
    assert len(decoded) > 100
    assert all(state.inputs == 2 and any(state.u) == any(state.u[:2]) for state in decoded)


def test_a_log_may_hold_both_layouts(tmp_path):
    layout = next(of for of in OLDER_LAYOUTS if of.message_type is lcmtypes.sampler_state_t)
    old = {name: k for k, (name, _, _) in enumerate(layout.fields)}
    new = lcmtypes.sampler_state_t()
    new.sequence = 7
    path = tmp_path / "log.lcm"
    with EventLogWriter(path) as log:
        for at_us, data in enumerate((encode(layout, old), new.encode(), encode(layout, old))):
            log.write("R1_SAMPLER_STATE", data, at_us)
    block = index_files([path], salvage=False)["R1_SAMPLER_STATE"]
    assert block.arrival_us.tolist() == [0, 1, 2]
    assert [lcmtypes.sampler_state_t.decode(data).sequence for data in block] == [1, 7, 1]


def test_a_layout_of_arrays_and_numbers_is_read_in_its_order():
    layout = OlderLayout(
        lcmtypes.goal_t,
        bytes(8),
        (Field("n", "int32_t"), Field("x", "double", "n"), Field("flag", "boolean")),
        lambda values: values,
        "nothing",
    )
    data = encode(layout, {"n": 2, "x": (1.5, -2.0), "flag": True})
    assert decode(layout, data) == {"n": 2, "x": [1.5, -2.0], "flag": True}
