"""The installed LCM types are those of the sources, and the channel table is sound."""

import filecmp
import importlib.util
import io
import re
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_messages import fields, has_fixed_size, messages

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.eventlog.eventlog import LONGEST_NAME
from koopman_lab.eventlog.older_layouts import OLDER_LAYOUTS
from koopman_lab.robots.robot_type import MOST_INPUTS, MOST_STATES

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "lcmtypes").glob("*.lcm"))
LONGEST_ROBOT_NAME = "R" * 16
"""As config/schema.py allows."""


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    spec = importlib.util.spec_from_file_location("hook", ROOT / "scripts" / "generate_types.py")
    hook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hook)
    return hook.generate(ROOT / "lcmtypes", tmp_path_factory.mktemp("types"))


def test_what_is_installed_is_what_the_sources_generate(generated):
    installed = Path(lcmtypes.__file__).parent
    names = {f.name for f in generated.iterdir()}
    assert {f.name for f in installed.iterdir() if f.is_file()} == names
    _, differing, missing = filecmp.cmpfiles(generated, installed, names, shallow=False)
    remedy = "install again: pip install -e '.[dev]'"
    assert (differing, missing) == ([], []), remedy


FIXED = [t for t in (getattr(lcmtypes, s.stem) for s in SOURCES) if has_fixed_size(t)]


def by_lcm_gen(message):
    """Encode by the method that lcm-gen wrote and nobody replaces."""
    buffer = io.BytesIO()
    message._encode_one(buffer)
    return message._get_packed_fingerprint() + buffer.getvalue()


@pytest.mark.parametrize("kind", FIXED, ids=lambda k: k.__name__)
@given(st.data())
def test_the_codec_writes_and_reads_the_bytes_of_lcm_gen(kind, data):
    message = data.draw(messages(kind))
    wire = by_lcm_gen(message)
    assert message.encode() == wire
    expected = kind._decode_one(io.BytesIO(wire[8:]))
    for decoded in (kind.decode(wire), kind.decode(wire + b"rest")):
        for name in kind.__slots__:
            assert repr(getattr(decoded, name)) == repr(getattr(expected, name))


@pytest.mark.parametrize("kind", FIXED, ids=lambda k: k.__name__)
def test_the_codec_refuses_what_lcm_gen_refuses(kind):
    wire = kind().encode()
    for other in (b"", wire[:7], bytes(8) + wire[8:]):
        with pytest.raises(ValueError, match="Decode error"):
            kind.decode(other)
    for short in (wire[:8], wire[:-1]):
        with pytest.raises(struct.error):
            kind.decode(short)


def test_each_source_holds_the_struct_it_is_named_after():
    for source in SOURCES:
        assert re.findall(r"struct (\w+)", source.read_text()) == [source.stem]
        assert source.stem.endswith("_t")


def test_all_fingerprints_differ_those_of_older_layouts_too():
    fingerprints = [getattr(lcmtypes, s.stem)._get_packed_fingerprint() for s in SOURCES]
    fingerprints += [layout.fingerprint for layout in OLDER_LAYOUTS]
    assert len(set(fingerprints)) == len(fingerprints)


def test_arrays_of_the_robot_have_one_length_in_all_messages():
    lengths = {"u": MOST_INPUTS, "state_in_goal_frame": MOST_STATES}
    for kind in (lcmtypes.mpc_state_t, lcmtypes.sampler_state_t, lcmtypes.reference_state_t):
        assert kind.MOST_INPUTS == MOST_INPUTS
        for name, _, length in fields(kind):
            assert name not in lengths or length == lengths[name]


def test_every_message_begins_with_its_time_and_its_number():
    for source in SOURCES:
        message = getattr(lcmtypes, source.stem)
        assert message.__slots__[:2] == ["utime", "sequence"]
        assert message.__typenames__[:2] == ["int64_t", "int64_t"]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.stem)
def test_every_field_is_explained(source):
    lines = source.read_text().splitlines()
    fields = [i for i, line in enumerate(lines) if re.match(r"    (?!const|//)\w+ +\w+.*;", line)]
    assert fields
    for i in fields:
        assert lines[i - 1].strip().startswith("//"), f"no unit or meaning: {lines[i].strip()}"


def test_every_channel_has_a_type_of_ours_and_a_name_that_lcm_takes():
    names = [c.suffix for c in channels.CHANNELS]
    assert len(set(names)) == len(names)
    for channel in channels.CHANNELS:
        assert channel.type.__name__ in {s.stem for s in SOURCES}
        assert re.fullmatch(r"[A-Z][A-Z0-9_]*", channel.suffix)
        assert len(channel.name(LONGEST_ROBOT_NAME)) <= LONGEST_NAME


def test_every_type_is_spoken_on_some_channel():
    assert {c.type.__name__ for c in channels.CHANNELS} == {s.stem for s in SOURCES}
