"""The one reader of YAML: what it refuses, in one line that names the place, and at what cost."""

import tracemalloc
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from koopman_lab.config.layer import override_layer, parse_layer
from koopman_lab.config.load import dump_config, load_config, parse_config, read_record
from koopman_lab.config.yaml_text import DEEPEST, LARGEST_BYTES, LOADER, parse_yaml
from koopman_lab.errors import ConfigError


def safe_load(text: str) -> Any:
    """Return what PyYAML's own safe loader, the same that the reader stands on, makes of a text."""
    return yaml.load(text, LOADER)


LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
"""Nine to the ninth values in some 400 bytes."""

REFUSED = {
    "aliases that multiply": (LAUGHS, "1: the anchor &a"),
    "an alias of nothing": ("a: *b\n", "1: the alias *b"),
    "a structure within itself": ("seed: 1\na: &a\n  b: *a\n", "2: the anchor &a"),
    "an anchor alone": ("seed: &s 1\n", "1: the anchor &s"),
    "a merge key": ("<<: {seed: 1}\n", "1: the merge key <<"),
    "a key twice": (
        "seed: 1\nbus: {}\nseed: 2\n",
        "3: seed is said for the second time (first in ",
    ),
    "a key twice below": (
        "controller:\n  horizon: 3\n  horizon: 4\n",
        "3: controller.horizon is said for the second time (first in line 2)",
    ),
    "a key twice in two spellings": ("1: a\n0x1: b\n", "2: 0x1 is said for the second time"),
    "a key that is a list": ("? [a, b]\n: 1\n", "1: a key that is no word"),
    "deep flow": ("a: " + "[" * 100 + "]" * 100, "1: nested deeper than"),
    "very deep flow": ("a: " + "[" * 100_000, "1: n"),
    "deep blocks": (
        "\n".join(" " * k + f"k{k}:" for k in range(DEEPEST + 5)),
        f"{DEEPEST + 2}: nested deeper than",
    ),
    "a tag": ("seed: !!python/object/apply:os.system ['true']\n", "1: the tag "),
    "a tag of its own": ("seed: !other 1\n", "1: the tag !other"),
    "a number of many digits": ("\nseed: " + "9" * 100_000, "2: a number of 100000 characters"),
    "a sexagesimal number": ("seed: " + ":".join(["59"] * 50_000), "1: a number of "),
    "a day that is none": ("\n\nseed: 2001-99-99\n", "3: '2001-99-99' is no value"),
    "two documents": ("seed: 1\n---\nseed: 2\n", "2: a second document"),
    "a control character": ("seed: 1\nbus: \x07\n", "2: not valid YAML: the character at position"),
    "half a character": ("seed: 1\nbus: \udc80\n", "2: not valid YAML: a character is half of one"),
    "too long": ("# " + "x" * LARGEST_BYTES, " longer than 256 KiB"),
    "too long in bytes": ("# " + "\u20ac" * (LARGEST_BYTES // 2), " longer than 256 KiB"),
    "a tab": ("a:\n\tb: 1\n", "2: not valid YAML: "),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_no_configuration_needs_is_refused_in_one_line_that_names_the_place(what):
    text, said = REFUSED[what]
    with pytest.raises(ConfigError) as error:
        parse_yaml(text, "lab.yaml")
    message = str(error.value)
    assert message.startswith(f"lab.yaml:{said}"), message
    assert "\n" not in message
    assert len(message) < 400


@pytest.mark.parametrize("what", REFUSED)
def test_refusing_costs_no_more_than_the_text_is_long(what):
    """A bomb is refused before anything is made of it."""
    text, _ = REFUSED[what]
    tracemalloc.start()
    try:
        with pytest.raises(ConfigError):
            parse_yaml(text, "lab.yaml")
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 100_000 + 60 * len(text)


@pytest.mark.parametrize("what", REFUSED)
def test_every_way_in_refuses_it(what, tmp_path):
    """A file, a record in a run folder, what a session says of itself, and an override."""
    text, _ = REFUSED[what]
    file = tmp_path / "lab.yaml"
    file.write_bytes(text.encode(errors="surrogateescape"))
    for read in (load_config, read_record):
        with pytest.raises(ConfigError):
            read(file)
    with pytest.raises(ConfigError):
        parse_config(text, "R1_SESSION_INFO")
    if "\n" not in text.strip():
        with pytest.raises(ConfigError):
            override_layer(f"bus={{{text.strip()}}}")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"seed: 1\nbus: \xff\n", "lab.yaml:2: cannot be read as a configuration: the byte at "),
        (b"seed: 1\nbus: \xff\n", "position 13 (0xff) is not UTF-8"),
        ("seed: 1\n".encode("utf-16"), "position 0 (0xff) is not UTF-8"),
        (b"seed: 1 # caf\xe9\n", "position 13 (0xe9) is not UTF-8"),
    ],
)
def test_a_file_that_is_not_utf8_is_told_the_byte(tmp_path, data, said):
    file = tmp_path / "lab.yaml"
    file.write_bytes(data)
    with pytest.raises(ConfigError) as error:
        load_config(file)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_bytes(b"\xef\xbb\xbfseed: 7\n")
    assert load_config(file).seed == 7


def test_a_file_without_end_is_not_read_to_it():
    with pytest.raises(ConfigError, match="/dev/zero: longer than 256 KiB"):
        load_config(Path("/dev/zero"))


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=20,
    )
)
@example({"a": [1, {"b": None}], "2": "2", "": {}})
def test_what_was_dumped_reads_back_as_with_the_safe_loader(value):
    dumped = yaml.safe_dump(value)
    if "&" in dumped:
        return  # equal values are one object to hypothesis now and then
    assert parse_yaml(dumped, "dump").value == safe_load(dumped)


@given(st.text(st.sampled_from("ab:-[]{}&*!|>'\"%@#?, \n\t0"), max_size=60))
def test_any_text_is_read_as_the_safe_loader_reads_it_or_refused(text):
    try:
        value = parse_yaml(text, "x").value
    except ConfigError:
        return
    assert value == safe_load(text)


def test_lines_are_those_of_the_keys():
    layer = parse_layer("a: 1\n\nb:\n  c: [1,\n    2]\n", "x")
    assert layer.lines == {
        ("a",): 1,
        ("b",): 3,
        ("b", "c"): 4,
        ("b", "c", "0"): 4,
        ("b", "c", "1"): 5,
    }


def test_a_whole_configuration_takes_a_small_part_of_what_is_allowed():
    longest = max(len(dump_config(load_config(robot=r))) for r in ("kinematic", "dynamic"))
    assert 20 * longest < LARGEST_BYTES
