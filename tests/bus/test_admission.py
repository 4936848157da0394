"""Every protected channel, with each way in which a message can carry the key's tag or not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.admission import (
    MOST_NAMES,
    Admission,
    Admissions,
    StreamAdmission,
    admission_of,
)
from koopman_lab.bus.authentication import Signer
from koopman_lab.bus.lab_key import KEY_BYTES
from koopman_lab.bus.replay_guard import GONE_US, SAME_SENDER_US, SILENCE_US
from koopman_lab.eventlog.older_layouts import OLDER_LAYOUTS

KEY, OTHER_KEY = b"k" * KEY_BYTES, b"o" * KEY_BYTES
MUST_NOT_BE_OPEN = {
    *("VELOCITY_CMD", "ACCELERATION_CMD", "MOTOR_CMD", "ESTOP", "GOAL", "TIME_PONG"),
    *("ONBOARD_STATUS", "PLANT_RESET", "FAULT", "PROCESS", "WHEEL_STATE", "LOGGER_STATUS"),
}
"""What moves a robot, lets it go, or is believed before either."""
ALWAYS = [c for c in channels.all_channels() if c.protection == "always"]
WHEN_SIGNED = [c for c in channels.all_channels() if c.protection == "when signed"]
NEVER = [c for c in channels.all_channels() if c.protection == "never"]


def ids(channel):
    return channel.suffix


def encoded(channel):
    """Return a message of a channel; one of ESTOP lets a robot go."""
    return channel.type().encode()


def flipped(data, byte):
    changed = bytearray(data)
    changed[byte] ^= 1
    return bytes(changed)


WAYS = {
    "right key": lambda name, data: Signer(KEY).sign(name, data),
    "no tag": lambda _, data: data,
    "wrong key": lambda name, data: Signer(OTHER_KEY).sign(name, data),
    "of another channel": lambda _, data: Signer(KEY).sign("R1_MPC_STATE", data),
    "of another robot": lambda name, data: Signer(KEY).sign(name.replace("R1", "R2"), data),
    "bit of the message flipped": lambda name, data: flipped(Signer(KEY).sign(name, data), 12),
    "bit of the tag flipped": lambda name, data: flipped(Signer(KEY).sign(name, data), -1),
    "tag cut": lambda name, data: Signer(KEY).sign(name, data)[:-1],
    "more behind the tag": lambda name, data: Signer(KEY).sign(name, data) + b"\0",
}


def test_what_moves_a_robot_or_lets_it_go_is_protected():
    assert {channel.suffix for channel in ALWAYS} == MUST_NOT_BE_OPEN
    assert {channel.suffix for channel in WHEN_SIGNED} == {"MOCAP_POSE", "ENCODER"}
    commanded = [channel for channel in channels.all_channels() if channel.is_command]
    assert set(commanded) <= set(ALWAYS)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("channel", ALWAYS, ids=ids)
def test_only_the_right_key_opens_a_protected_channel(channel, way):
    name = channel.name("R1")
    said = WAYS[way](name, encoded(channel))
    admission, admissions = Admission(KEY, channel, name), Admissions(KEY)
    is_right = way == "right key"
    assert admission.admits(said) == admissions.admits(name, said) == is_right
    assert admission.without_key == (not is_right)
    # What is let in once is a replay from then on.
    assert not admission.admits(said)
    assert not admissions.admits(name, said)
    assert admission.repeated == is_right


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("channel", NEVER, ids=ids)
def test_on_all_other_channels_everybody_may_speak(channel, way):
    name = channel.name("R1")
    said = WAYS[way](name, encoded(channel))
    admissions = Admissions(KEY)
    assert admissions.admits(name, said)
    assert admissions.admits(name, said)


@pytest.mark.parametrize("channel", WHEN_SIGNED, ids=ids)
def test_cameras_and_encoders_may_lack_the_key_until_one_that_has_it_speaks(channel):
    name, data = channel.name("R1"), encoded(channel)
    admission, admissions, signer = Admission(KEY, channel, name), Admissions(KEY), Signer(KEY)

    def admits(said):
        one, other = admission.admits(said), admissions.admits(name, said)
        assert one == other
        return one

    assert admits(data)
    assert not admits(Signer(OTHER_KEY).sign(name, data))
    assert admits(data)
    assert admits(signer.sign(name, data))
    assert not admits(data)
    assert admits(signer.sign(name, data))
    assert admission.without_key == 2


def stop(*, engaged):
    message = lcmtypes.estop_t()
    message.engaged = engaged
    return message.encode()


@pytest.mark.parametrize("way", WAYS)
def test_anybody_may_stop_a_robot_as_often_as_he_likes(way):
    name = channels.ESTOP.name("R1")
    said = WAYS[way](name, stop(engaged=True))
    admission = Admission(KEY, channels.ESTOP, name)
    # A flipped bit of the message may hit anything: here the sequence.
    assert all(admission.admits(said) for _ in range(3))
    assert admission.without_key == admission.repeated == 0
    assert not admission.admits(stop(engaged=False))


def test_a_kill_switch_of_an_older_version_stops_and_releases_nothing():
    """Its messages have no number of a stop; see the layouts of older versions."""
    (layout,) = [row for row in OLDER_LAYOUTS if row.message_type is lcmtypes.estop_t]
    body = bytes(16)
    admission = Admission(KEY, channels.ESTOP, "R1_ESTOP")
    assert admission.admits(layout.fingerprint + body + b"\1")
    assert not admission.admits(layout.fingerprint + body + b"\0")
    assert not admission.admits(layout.fingerprint + body)


def test_who_invents_names_endlessly_fills_no_memory():
    admissions = Admissions(KEY)
    for k in range(3 * MOST_NAMES):
        assert not admissions.admits(f"X{k}_MOTOR_CMD", b"drive")
        assert admissions.admits(f"X{k}_SOMETHING", b"else")
    assert len(admissions._protected) <= MOST_NAMES
    assert not admissions._admissions


def test_a_replay_is_noticed_also_after_others_have_invented_names():
    admissions, name = Admissions(KEY), "R1_GOAL"
    said = Signer(KEY).sign(name, encoded(channels.GOAL))
    assert admissions.admits(name, said)
    for k in range(2 * MOST_NAMES):
        admissions.admits(f"X{k}_GOAL", b"")
    assert not admissions.admits(name, said)


def duties(signer, name, utime):
    message = channels.MOTOR_CMD.type()
    message.utime = utime
    return signer.sign(name, message.encode())


@pytest.mark.parametrize("channel", ALWAYS + WHEN_SIGNED, ids=ids)
def test_channels_of_one_publisher_by_wire_follow_one_sender(channel):
    follows = isinstance(admission_of(KEY, channel, "R1"), StreamAdmission)
    assert follows == (channel.suffix in ("ENCODER", "MOTOR_CMD"))


def talk(*said):
    """Return who of those that say something, each so long after the one before, is let in."""
    admission, now_us, admitted = admission_of(KEY, channels.MOTOR_CMD, "R1_MOTOR_CMD"), 10**15, []
    for signer, pause_us, ahead_us in said:
        now_us += pause_us
        data = duties(signer, "R1_MOTOR_CMD", now_us + ahead_us)
        admitted.append(admission.admits_at(data, now_us))
    return admitted


OLD = st.integers(SAME_SENDER_US + 1, 10**13)
"""How old what was recorded is, at least."""


@given(
    st.lists(st.integers(1, GONE_US - 1), min_size=2, max_size=20),
    OLD,
    st.integers(-(9**13), 9**13),
)
def test_what_was_recorded_is_no_stream_to_turn_to_where_the_live_one_comes_late(
    pauses_us, age_us, step_us
):
    """Also where the clock of the live one is set, since its number stays."""
    live, log = Signer(KEY), Signer(KEY)
    said = [(live, 0, 0)]
    for pause_us in pauses_us:
        said += [(log, pause_us, -age_us), (live, 0, step_us)]
    assert talk(*said) == [True] + [False, True] * len(pauses_us)


@given(OLD)
def test_who_is_started_again_is_followed_at_once_and_a_log_after_a_second(age_us):
    first, log, second = Signer(KEY), Signer(KEY), Signer(KEY)
    assert talk((first, 0, 0), (second, SILENCE_US - 1, 0), (second, 1, 0)) == [True, False, True]
    assert talk((first, 0, 0), (log, GONE_US - 1, -age_us), (log, 1, -age_us)) == [
        *(True, False, True),
    ]
    # Who is live is followed before a log that is, and a board whose clock is wrong after a second.
    assert talk((log, 0, -age_us), (second, 1, 0), (log, 1, -age_us)) == [True, True, False]
    assert talk((first, 0, 0), (second, GONE_US, -age_us), (second, 1, -age_us)) == [True] * 3
