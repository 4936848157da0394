"""The installed LCM types are those of the sources, and the channel table is sound."""

import filecmp
import importlib.util
import re
from pathlib import Path

import pytest

import lcmtypes
from koopman_lab.bus import channels

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


def test_each_source_holds_the_struct_it_is_named_after():
    for source in SOURCES:
        assert re.findall(r"struct (\w+)", source.read_text()) == [source.stem]
        assert source.stem.endswith("_t")


def test_all_fingerprints_differ():
    fingerprints = {getattr(lcmtypes, s.stem)._get_packed_fingerprint() for s in SOURCES}
    assert len(fingerprints) == len(SOURCES)


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
        assert len(channel.name(LONGEST_ROBOT_NAME)) <= channels.LONGEST_NAME


def test_every_type_is_spoken_on_some_channel():
    assert {c.type.__name__ for c in channels.CHANNELS} == {s.stem for s in SOURCES}
