import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_messages import messages

import lcmtypes
from koopman_lab.bus.channels import CHANNELS
from koopman_lab.data.message_arrays import decode_all, decode_each, native_dtype, wire_dtype
from koopman_lab.eventlog.message_blocks import Messages

TYPES = sorted({channel.type for channel in CHANNELS}, key=lambda t: t.__name__)
VARIABLE = {
    *(lcmtypes.mpc_state_t, lcmtypes.session_info_t),
    *(lcmtypes.process_t, lcmtypes.interlock_t),
}


@given(
    st.sampled_from([t for t in TYPES if t not in VARIABLE]).flatmap(
        lambda kind: st.tuples(st.just(kind), st.lists(messages(kind), max_size=4))
    )
)
def test_arrays_hold_what_the_generated_code_decodes(kind_and_messages):
    kind, sent = kind_and_messages
    array, bad = decode_all(kind, Messages.joined(m.encode() for m in sent))
    assert array.dtype.names == tuple(kind.__slots__)
    assert len(bad) == 0
    for row, message in zip(array, sent, strict=True):
        for name in kind.__slots__:
            assert row[name].tolist() == np.array(getattr(message, name)).tolist()


@pytest.mark.parametrize("kind", TYPES)
def test_fixed_sizes_are_those_of_the_wire_and_variable_ones_are_known(kind):
    if kind in VARIABLE:
        assert wire_dtype(kind) is None
        with pytest.raises(TypeError, match="no fixed size"):
            native_dtype(kind)
    else:
        assert wire_dtype(kind).itemsize == len(kind().encode())


def test_arrays_are_in_the_byte_order_of_this_machine():
    dtype = native_dtype(lcmtypes.mocap_pose_t)
    assert all(dtype[name].isnative for name in dtype.names)
    assert dtype["tracking_valid"] == np.dtype(bool)


class WithArrays:
    """Describes itself as a generated type does."""

    __slots__ = ("after", "image")
    __typenames__ = ("int64_t", "float")
    __dimensions__ = (None, (2, 3))

    @staticmethod
    def _get_packed_fingerprint():
        return b"\1" * 8


def test_fixed_arrays_become_subarrays():
    data = b"\1" * 8 + struct.pack(">q6f", -5, *range(6))
    array, bad = decode_all(WithArrays, Messages.joined([data, data]))
    assert len(bad) == 0
    assert array["after"].tolist() == [-5, -5]
    assert array["image"].tolist() == [[[0, 1, 2], [3, 4, 5]]] * 2


def spoilt():
    good = lcmtypes.mocap_pose_t()
    good.utime = 7
    data, other = good.encode(), lcmtypes.encoder_t().encode()
    return [data, other, data[:-1], b"", data + b"and what follows it", data], [1, 2, 3]


def test_messages_that_are_cut_or_of_another_fingerprint_are_left_out_and_named():
    """What follows a message counts for nothing, as for generated decoders: a tag may."""
    data, wrong = spoilt()
    array, bad = decode_all(lcmtypes.mocap_pose_t, Messages.joined(data))
    assert bad.tolist() == wrong
    assert array["utime"].tolist() == [7, 7, 7]


def test_generated_code_leaves_out_what_it_cannot_decode():
    info = lcmtypes.session_info_t()
    info.activity = "calibrate"
    data = info.encode()
    decoded, bad = decode_each(
        lcmtypes.session_info_t, [data, data[:30], b"", lcmtypes.estop_t().encode(), data]
    )
    assert [m.activity for m in decoded] == ["calibrate", "calibrate"]
    assert bad.tolist() == [1, 2, 3]
