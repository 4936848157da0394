"""Who spoke on a channel of a log: against logs of which the test knows who spoke."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import klab, klab_json
from speakers import Said, by_radio, encoded, speak

from koopman_lab.bus.channels import LOGGER_STATUS, MOCAP_POSE, ONBOARD_STATUS
from koopman_lab.bus.publishers import StreamIdentity
from koopman_lab.data.decode import SessionLog
from koopman_lab.eventlog.logwriter import EventLogWriter

BEGIN_US = 1_700_000_000_000_000
ONE, TWO = StreamIdentity(1, "counts"), StreamIdentity(2, "counts")


def identity(folder, said, channel=MOCAP_POSE):
    """Return who speaks on a channel of a log of these messages."""
    return SessionLog(write(folder, said, channel)).channels[channel.name("R1")].identity


def write(folder, said, channel=MOCAP_POSE):
    path = folder / "session.lcm"
    path.unlink(missing_ok=True)
    with EventLogWriter(path) as log:
        for message in sorted(said, key=lambda message: message.arrived_us):
            stamped = message._replace(utime=BEGIN_US + message.utime)
            data = encoded(channel, stamped)
            log.write(channel.name("R1"), data, BEGIN_US + message.arrived_us)
    return path


def twice(said):
    """Send each message twice, with a number of its own."""
    return [Said(m.arrived_us, 2 * m.sequence + k, m.utime) for m in said for k in (0, 1)]


HOUR_US = 3_600_000_000
CLOCK_SET = speak(240, 4) + speak(240, 4, first=960, start_us=4_000_000, clock_us=HOUR_US)
THREE = [message for k in range(3) for message in speak(240, 9, start_us=900 * k)]
STUCK = [
    message._replace(sequence=600 if 600 <= message.sequence < 1080 else message.sequence)
    for message in speak(240, 9)
]
LOGS = {
    "one": (speak(240, 9), ONE),
    "resumed after an hour": (speak(240, 4, first=80) + speak(240, 4, start_us=HOUR_US), ONE),
    "started again": (speak(240, 4) + speak(240, 4, start_us=4_100_000), ONE),
    "clock set by an hour": (CLOCK_SET, ONE),
    "two all the time": (speak(240, 9) + speak(240, 9, first=70_000, start_us=900), TWO),
    "two that began together": (speak(240, 9) + speak(240, 9, start_us=900), TWO),
    "two for 2 s": (speak(240, 20) + speak(240, 2, start_us=8_000_900), TWO),
    "three": (THREE, StreamIdentity(3, "counts")),
    "never counted": (
        [m._replace(sequence=0) for m in speak(240, 9)], StreamIdentity(1, "stands still"),
    ),
    "stuck for 2 s": (
        STUCK,
        StreamIdentity(1, "stands still"),
    ),
    "each twice": (twice(speak(240, 9)), StreamIdentity(1, "repeats")),
    "each twice for 2 s": (
        speak(240, 4) + twice(speak(240, 2, first=480, start_us=4_000_000)),
        StreamIdentity(1, "repeats"),
    ),
}  # fmt: skip


@pytest.mark.parametrize(("said", "expected"), LOGS.values(), ids=LOGS)
def test_a_log_says_who_spoke_where_it_was_worst(tmp_path, said, expected):
    assert identity(tmp_path, said) == expected


@given(st.integers(0, 2**32), st.sampled_from([10.0, 240.0]), st.floats(0.0, 2.0))
def test_what_a_bad_radio_makes_of_one_is_one(tmp_path_factory, seed, rate_hz, bursts_hz):
    bad = {
        **{"delay_s": 0.003, "jitter_s": 0.002, "duplication": 0.05, "reordering": 0.05},
        **{"held_back_s": 0.02, "burst_rate_hz": bursts_hz, "burst_s": 0.2},
    }
    said = speak(rate_hz, 30.0) + speak(rate_hz, 5.0, start_us=30_500_000)
    folder = tmp_path_factory.mktemp("log")
    assert identity(folder, by_radio(said, seed, **bad), ONBOARD_STATUS) == ONE


def test_the_command_names_the_channel_the_number_and_the_rate_and_json_has_both(tmp_path):
    write(tmp_path, LOGS["two all the time"][0])
    done = klab("log", "info", tmp_path)
    assert done.returncode == 0
    assert done.stderr.startswith(
        "R1_MOCAP_POSE (480 Hz): 2 publishers; a second camera bridge uses the name R1"
    )
    facts = klab_json("log", "info", tmp_path)["channels"]["R1_MOCAP_POSE"]
    assert (facts["publishers"], facts["numbering"]) == (2, "counts")


def test_the_loggers_of_two_commands_are_no_matter(tmp_path):
    write(tmp_path, LOGS["two all the time"][0], LOGGER_STATUS)
    assert klab("log", "info", tmp_path).stderr == ""
