"""Messages of any type with any values, for properties of codecs and layouts."""

from hypothesis import strategies as st

VALUES = {
    "int8_t": st.integers(-(2**7), 2**7 - 1),
    "int16_t": st.integers(-(2**15), 2**15 - 1),
    "int32_t": st.integers(-(2**31), 2**31 - 1),
    "int64_t": st.integers(-(2**63), 2**63 - 1),
    "byte": st.integers(0, 255),
    "float": st.floats(width=32, allow_nan=False),
    "double": st.floats(allow_nan=False),
    "boolean": st.booleans(),
}
LONGEST = 5
"""Of arrays whose length another field says."""


def has_fixed_size(kind):
    """Return whether all messages of a generated type are of one size."""
    lengths = [n for shape in kind.__dimensions__ for n in shape or ()]
    return "string" not in kind.__typenames__ and all(isinstance(n, int) for n in lengths)


def fields(kind):
    """Return (name, LCM type, length) of each field of a generated type; None if it is no array."""
    table = zip(kind.__slots__, kind.__typenames__, kind.__dimensions__, strict=True)
    return [(name, wire, shape[0] if shape else None) for name, wire, shape in table]


@st.composite
def values(draw, layout):
    """Return values by name for fields (name, LCM type, length)."""
    lengths = {n for _, _, n in layout if isinstance(n, str)}
    drawn = {}
    for name, wire, length in layout:
        one = st.integers(0, LONGEST) if name in lengths else VALUES[wire]
        if length is None:
            drawn[name] = draw(one)
        else:
            count = drawn[length] if isinstance(length, str) else length
            drawn[name] = tuple(draw(st.lists(one, min_size=count, max_size=count)))
    return drawn


@st.composite
def messages(draw, kind):
    """Return a message of a generated type without strings."""
    message = kind()
    for name, value in draw(values(fields(kind))).items():
        setattr(message, name, value)
    return message
