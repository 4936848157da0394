"""Changes to files that a reader must survive, drawn by hypothesis from files that are whole."""

import io
import json

import numpy as np
from hypothesis import strategies as st

NUMBERS = [0, 1, -1, 7, 127, 255, 2**16, 2**31 - 1, -(2**31), 2**32 - 1, 2**62, 2**63 - 1, -(2**63)]
SCALARS = st.sampled_from(
    [
        *(None, True, False, 0, 1, -1, 3, 2**31, 2**63, 10**30, 0.5, -0.0, 1e-300, 1e9, 1e300),
        *(float("nan"), float("inf"), -float("inf"), "", "x", "../../x", "0.05", "nan", "\0", "é"),
        *("kinematic", "dynamic", "paper", "edmd", "x" * 5000, "\x1b[2J", "[/0]", "2024-01-01"),
    ]
)
JSON = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["offset", "data", "1", "level", ""]), inner, max_size=3)
    ),
    max_leaves=6,
)
DTYPES = ["<f8", ">f8", "<f4", "<f2", "<i8", "<i4", "<u8", "|b1", "<c16", "<U3", "|S2", "<M8[us]"]
SHAPES = st.lists(st.sampled_from([0, 1, 2, 3, 5, 8]), max_size=4).map(tuple)
WORDS = st.sampled_from(
    [
        *("", ".nan", ".inf", "-1", "1e999", "[]", "{}", "null", "~", "x", '"', "'", "*a"),
        *("0x1g", "1_0", "0o9", "2024-02-30", "1:30", "<<", "- - -", "|", ">", "%", "#", "---"),
        *("[1, [2", "{a: 1", "? x", "\t", "!!python/tuple", "!!binary x", "\ufeff"),
    ]
)  # fmt: skip


@st.composite
def changed_bytes(draw, content, others=()):
    """Return bytes with a few of them changed, cut, doubled, put in or taken from another file."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        size = draw(st.sampled_from([1, 1, 2, 4, 8, 40]))
        kind = draw(st.integers(0, 7))
        if kind == 0 and at < len(data):
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == 1:
            data[at : at + size] = draw(st.binary(min_size=size, max_size=size))
        elif kind == 2:
            order = draw(st.sampled_from(["big", "little"]))
            number = draw(st.sampled_from(NUMBERS)) % 2 ** (8 * size)
            data[at : at + size] = number.to_bytes(size, order)
        elif kind == 3:
            del data[at : at + size]
        elif kind == 4:
            data[at:at] = data[at : at + size] * draw(st.integers(1, 5))
        elif kind == 5:
            del data[at:]
        elif kind == 6:
            data[at:at] = draw(st.binary(max_size=40))
        elif others:
            other = draw(st.sampled_from(list(others)))
            start = draw(st.integers(0, len(other)))
            data[at : at + size] = other[start : start + size]
    return bytes(data)


@st.composite
def changed_lines(draw, content, others=()):
    """Return text with values, lines and their order changed; now and then any bytes."""
    if draw(st.integers(0, 3)) == 0:
        return draw(changed_bytes(content, others))
    lines = content.decode(errors="replace").splitlines() or [""]
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(lines) - 1))
        kind = draw(st.integers(0, 4))
        if kind == 0:
            lines[at] = lines[at].partition(":")[0] + ": " + draw(WORDS)
        elif kind == 1:
            lines.insert(at, draw(WORDS))
        elif kind == 2:
            lines.insert(at, lines[draw(st.integers(0, len(lines) - 1))])
        elif kind == 3:
            words = lines[at].split(" ")
            words[draw(st.integers(0, len(words) - 1))] = draw(WORDS)
            lines[at] = " ".join(words)
        elif len(lines) > 1:
            del lines[at]
    return "\n".join(lines).encode()


@st.composite
def changed_json(draw, content, others=()):
    """Return JSON with a value of it exchanged, taken away or put in; now and then any bytes."""
    if draw(st.integers(0, 3)) == 0:
        return draw(changed_bytes(content, others))
    try:
        value = json.loads(content)
    except ValueError:
        return draw(changed_bytes(content, others))
    return json.dumps(_changed(draw, value)).encode()


@st.composite
def changed_npz(draw, content, others=()):
    """Return an archive whose header or arrays are changed and whose sums are right."""
    if draw(st.integers(0, 4)) == 0:
        return draw(changed_bytes(content, others))
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = dict(file)
        header = json.loads(bytes(arrays.pop("header")))
    except Exception:
        return draw(changed_bytes(content, others))
    if draw(st.booleans()):
        header = _changed(draw, header)
    for _ in range(draw(st.integers(0, 2))):
        if not arrays:
            break
        name = draw(st.sampled_from(sorted(arrays)))
        kind = draw(st.integers(0, 3))
        if kind == 0:
            del arrays[name]
        elif kind == 1:
            arrays[name] = np.zeros(draw(SHAPES), draw(st.sampled_from(DTYPES)))
        elif kind == 2 and arrays[name].size and arrays[name].dtype.kind in "fi":
            array = arrays[name].copy()
            place = draw(st.integers(0, array.size - 1))
            largest = np.finfo if array.dtype.kind == "f" else np.iinfo
            numbers = [0, 1, -1, largest(array.dtype).max, largest(array.dtype).min]
            array.flat[place] = draw(
                st.sampled_from(numbers + [np.nan, np.inf] * (largest is np.finfo))
            )
            arrays[name] = array
        else:
            arrays[draw(st.sampled_from(["X_1", "Y_1", "matrices", "other"]))] = arrays[name]
    text = json.dumps(header).encode()
    made = io.BytesIO()
    np.savez(made, header=np.frombuffer(text, np.uint8), **arrays)
    return made.getvalue()


def _changed(draw, value):
    """Return JSON with one value at any depth exchanged, taken away or put in."""
    if isinstance(value, (dict, list)) and value and draw(st.integers(0, 9)):
        copy = value.copy()
        keys = sorted(copy) if isinstance(copy, dict) else range(len(copy))
        key = draw(st.sampled_from(list(keys)))
        kind = draw(st.integers(0, 9))
        if kind == 0:
            del copy[key]
        elif kind == 1 and isinstance(copy, dict):
            copy[f"{key}x"] = draw(JSON)
        else:
            copy[key] = _changed(draw, copy[key])
        return copy
    return draw(JSON)
