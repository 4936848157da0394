"""Which stamps of a log count, whatever is written beside them."""

import csv

import numpy as np
import pytest
from hostile.times import DAY_US, HOSTILE, HOUR_US, LARGEST, SMALLEST
from hypothesis import given
from hypothesis import strategies as st
from klab import klab
from mcap.reader import make_reader
from synthetic_session import EPOCH_US, Session

import lcmtypes
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.plausible_stamps import ASTRAY_US, FEW, plausible

FAR = {
    what: stamp_of for what, stamp_of in HOSTILE.items() if abs(stamp_of(EPOCH_US) - EPOCH_US) > 1e8
}
TIMES = EPOCH_US + 4_167 * np.arange(2400)


@pytest.mark.parametrize("what", FAR)
@pytest.mark.parametrize("place", [0, 1000, 2400])
@pytest.mark.parametrize("count", [1, FEW])
def test_a_few_stamps_of_another_time_are_left_out_and_no_other(what, place, count):
    times = np.insert(TIMES, place, [FAR[what](EPOCH_US)] * count)
    expected = np.ones(len(times), bool)
    expected[place : place + count] = False
    assert np.array_equal(plausible(times), expected)


@given(st.permutations(range(410)), st.integers(-(2**63), 2**63 - 1))
def test_the_order_of_arrival_says_nothing(order, stray):
    times = np.append(TIMES[:409], stray)
    assert np.array_equal(plausible(times[order]), plausible(times)[order])


@pytest.mark.parametrize("pause_us", [HOUR_US, 7 * DAY_US, -HOUR_US, -7 * DAY_US])
def test_a_session_that_goes_on_later_and_a_clock_that_was_set_stay(pause_us):
    assert plausible(np.concatenate([TIMES, TIMES[:5] + pause_us])).all()
    assert plausible(np.concatenate([TIMES, TIMES + pause_us])).all()


@given(st.lists(st.integers(-(2**61), 2**61), max_size=60))
def test_of_few_messages_far_apart_all_stay(times):
    assert plausible(np.array(times, np.int64)).all()


def test_what_is_no_clock_never_counts_however_often_it_comes():
    times = np.array([SMALLEST, LARGEST] * 300)
    assert not plausible(times).any()


@given(st.lists(st.integers(-(2**63), 2**63 - 1), max_size=300))
def test_differences_of_what_is_left_fit_into_64_bits(stamps):
    times = np.array([*TIMES.tolist(), *stamps], np.int64)
    left = times[plausible(times)].tolist()
    assert max(left) - min(left) < 2**63
    assert len(left) >= len(TIMES)


def with_stray_frames(session):
    """Return the messages of a session, and among its frames one of every hostile time."""
    messages = session.messages()
    for k, (what, stamp_of) in enumerate(FAR.items()):
        place = 100 + 37 * k
        frame = lcmtypes.mocap_pose_t()
        frame.utime = max(SMALLEST, min(LARGEST, stamp_of(messages[place][2])))
        frame.sequence, frame.tracking_valid, frame.x1_m = 10**6 + 1000 * k, True, 0.5
        assert what
        messages.insert(place, ("R1_MOCAP_POSE", frame.encode(), messages[place][2]))
    return messages


def test_frames_of_all_hostile_times_change_nothing_that_is_learned(tmp_path):
    session = Session("dynamic", segments=2)
    plain = session.write(tmp_path / "plain.lcm")
    strayed = session.write(tmp_path / "strayed.lcm", with_stray_frames(session))
    assert DataSet.from_log(strayed).data_hash == DataSet.from_log(plain).data_hash
    summary = SessionLog(strayed).channels["R1_MOCAP_POSE"]
    good = SessionLog(plain).channels["R1_MOCAP_POSE"]
    assert summary.unreadable == len(FAR)
    assert (summary.first_us, summary.last_us) == (good.first_us, good.last_us)
    assert summary.rate_hz == pytest.approx(good.rate_hz)
    assert SessionLog(strayed).duration_s == SessionLog(plain).duration_s


def test_every_command_on_such_a_log_ends_in_order(tmp_path):
    session = Session("dynamic", segments=2)
    log = session.write(tmp_path / "s.lcm", with_stray_frames(session))
    for command in (
        ("log", "info", log),
        ("log", "plot", log, "--out", tmp_path / "plot"),
        ("log", "export", log, "--out", tmp_path / "csv"),
        ("log", "export", log, "--format", "mcap", "--out", tmp_path / "s.mcap"),
    ):
        done = klab(*command)
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
    # The time axis is the session's.
    with (tmp_path / "plot-path.csv").open() as file:
        times_s = [float(row["time_s"]) for row in csv.DictReader(file)]
    assert len(times_s) == len(session.frames)
    assert times_s[0] == 0.0
    assert max(times_s) < 60.0
    # What is exported is all of it, as far as the formats can say it.
    with (tmp_path / "csv" / "R1_MOCAP_POSE.csv").open() as file:
        assert sum(1 for _ in file) == 1 + len(session.frames) + len(FAR)
    with (tmp_path / "s.mcap").open("rb") as stream:
        read = list(make_reader(stream).iter_messages(topics="R1_MOCAP_POSE"))
    assert len(read) == len(session.frames) + len(FAR)
    assert ASTRAY_US < HOUR_US
