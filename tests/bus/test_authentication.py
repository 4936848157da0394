"""The trailer behind a message: who can make it, and what a receiver does with it."""

import hashlib
import hmac
import struct
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.authentication import (
    MAGIC,
    MOST_SENDERS,
    TRAILER_BYTES,
    WINDOW,
    Signer,
    Verdict,
    Verifier,
)
from koopman_lab.bus.lab_key import KEY_BYTES

KEY = bytes(range(KEY_BYTES))
names = st.text(st.characters(codec="utf-8"), min_size=1, max_size=40)
keys = st.binary(min_size=KEY_BYTES, max_size=KEY_BYTES)
payloads = st.binary(max_size=300)


@given(keys, names, st.binary(min_size=8, max_size=8), payloads)
def test_the_tag_is_hmac_sha256_over_channel_sender_counter_and_message(key, name, sender, data):
    signer = Signer(key, sender)
    for counter in range(3):
        signed = signer.sign(name, data)
        encoded = name.encode()
        covered = struct.pack(">H", len(encoded)) + encoded + sender + struct.pack(">Q", counter)
        tag = hmac.digest(key, covered + data, hashlib.sha256)[:16]
        assert signed == data + MAGIC + sender + struct.pack(">Q", counter) + tag
        assert len(signed) == len(data) + TRAILER_BYTES


@given(keys, names, st.lists(payloads, min_size=1, max_size=10))
def test_each_message_is_valid_once(key, name, messages):
    signer, verifier = Signer(key), Verifier(key, name)
    signed = [signer.sign(name, data) for data in messages]
    assert [verifier.judge(data) for data in signed] == [Verdict.VALID] * len(signed)
    assert [verifier.judge(data) for data in signed] == [Verdict.REPEATED] * len(signed)


@given(names, payloads, st.data())
def test_no_bit_can_be_changed(name, data, draw):
    signed = Signer(KEY).sign(name, data)
    bit = draw.draw(st.integers(0, 8 * len(signed) - 1))
    changed = bytearray(signed)
    changed[bit // 8] ^= 1 << bit % 8
    in_magic = 0 <= bit // 8 - len(data) < len(MAGIC)
    expected = Verdict.UNSIGNED if in_magic else Verdict.FORGED
    verifier = Verifier(KEY, name)
    assert verifier.judge(bytes(changed)) is expected
    assert verifier.judge(signed) is Verdict.VALID


@given(keys, keys, names, names, payloads)
def test_another_key_or_channel_makes_no_tag(key, other_key, name, other_name, data):
    signed = Signer(key).sign(name, data)
    if other_key != key:
        assert Verifier(other_key, name).judge(signed) is Verdict.FORGED
    if other_name != name:
        assert Verifier(key, other_name).judge(signed) is Verdict.FORGED


@given(names, names, payloads)
def test_no_name_can_be_taken_for_a_longer_one_with_a_shorter_message(name, ending, data):
    """Whatever stands where the channel's name ends, another name gives another tag."""
    signed = Signer(KEY, b"12345678").sign(name + ending, data)
    assert Verifier(KEY, name).judge(ending.encode() + signed) is Verdict.FORGED


@given(st.binary(max_size=120))
def test_any_bytes_are_judged(data):
    assert Verifier(KEY, "R1_GOAL").judge(data) in (Verdict.UNSIGNED, Verdict.FORGED)


@given(st.lists(st.integers(0, 3 * WINDOW), max_size=300))
def test_counters_in_any_order_pass_once_and_only_within_the_window(order):
    """The oracle keeps all that was heard."""
    signer, verifier = Signer(KEY), Verifier(KEY, "R1_GOAL")
    signed = [signer.sign("R1_GOAL", b"") for _ in range(3 * WINDOW + 1)]
    heard = set()
    for counter in order:
        is_new = counter not in heard and counter > max(heard, default=-1) - WINDOW
        expected = Verdict.VALID if is_new else Verdict.REPEATED
        assert verifier.judge(signed[counter]) is expected
        heard.add(counter)


@given(st.permutations(range(3)), st.integers(1, 5))
def test_several_senders_do_not_disturb_each_other(turns, rounds):
    signers, verifier = [Signer(KEY) for _ in turns], Verifier(KEY, "R1_ESTOP")
    for _ in range(rounds):
        for k in turns:
            assert verifier.judge(signers[k].sign("R1_ESTOP", b"")) is Verdict.VALID


def test_a_sender_that_starts_again_is_believed_at_once_whatever_its_clock():
    """Its number is drawn anew, so that its counters begin again without any clock."""
    verifier, before = Verifier(KEY, "R1_GOAL"), Signer(KEY)
    old = [before.sign("R1_GOAL", b"go") for _ in range(1000)]
    assert verifier.judge(old[-1]) is Verdict.VALID
    assert verifier.judge(Signer(KEY).sign("R1_GOAL", b"go")) is Verdict.VALID
    assert verifier.judge(old[0]) is Verdict.REPEATED
    assert verifier.judge(old[-1]) is Verdict.REPEATED


def test_only_as_many_senders_are_kept_and_the_silent_give_way():
    verifier, steady = Verifier(KEY, "R1_ESTOP"), Signer(KEY)
    said = deque([steady.sign("R1_ESTOP", b"")], maxlen=1)
    assert verifier.judge(said[0]) is Verdict.VALID
    for _ in range(2 * MOST_SENDERS):
        assert verifier.judge(Signer(KEY).sign("R1_ESTOP", b"")) is Verdict.VALID
        said.append(steady.sign("R1_ESTOP", b""))
        assert verifier.judge(said[0]) is Verdict.VALID
        assert verifier.judge(said[0]) is Verdict.REPEATED
    assert len(verifier._senders) == MOST_SENDERS


@pytest.mark.parametrize("size", [0, TRAILER_BYTES - 1, TRAILER_BYTES, TRAILER_BYTES + 1])
def test_what_is_too_short_or_has_no_magic_has_no_trailer(size):
    assert Verifier(KEY, "R1_GOAL").judge(bytes(size)) is Verdict.UNSIGNED
