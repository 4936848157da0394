import numpy as np
import pytest
from synthetic_session import EPOCH_US, Session

import lcmtypes
from koopman_lab.bus.channels import (
    ENCODER,
    LOGGER_STATUS,
    MOCAP_POSE,
    ONBOARD_STATUS,
    SAMPLER_STATE,
    SESSION_INFO,
)
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.data.channel_summary import ChannelSummary
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import ConfigError, LogError
from koopman_lab.eventlog.logwriter import EventLogWriter

SYNC = b"\xed\xa1\xda\x01"
"""How every event of a log begins."""


@pytest.fixture(scope="module")
def session():
    return Session("kinematic", segments=1)


@pytest.fixture
def path(session, tmp_path):
    return session.write(tmp_path / "session.lcm")


def frames(numbers, robot="R1"):
    made = []
    for number in numbers:
        pose = lcmtypes.mocap_pose_t()
        pose.utime, pose.sequence = 1000 * number, number
        made.append((MOCAP_POSE.name(robot), pose.encode(), 5_000_000))
    return made


def write(path, messages):
    with EventLogWriter(path) as log:
        for message in messages:
            log.write(*message)
    return path


def test_a_session_folder_stands_for_its_log(path):
    assert SessionLog(path.parent).path == path
    with pytest.raises(LogError, match="no such log"):
        SessionLog(path.parent / "none")


def test_channels_are_counted_by_their_own_time(session, path):
    log = SessionLog(path)
    assert list(log.channels) == ["R1_MOCAP_POSE", "R1_SAMPLER_STATE", "R1_SESSION_INFO"]
    seen = log.channels["R1_MOCAP_POSE"]
    assert seen.count == len(session.frames)
    assert (seen.first_us, seen.last_us) == (EPOCH_US, session.frames[-1].utime)
    assert seen.rate_hz == pytest.approx(240.0, rel=1e-4)
    assert (seen.lost, seen.gaps) == (0, 0)
    assert log.channels["R1_SESSION_INFO"].rate_hz is None
    last_us = max(session.frames[-1].utime, session.states[-1].utime)
    assert log.duration_s == pytest.approx((last_us - EPOCH_US) / 1e6)


def test_loss_is_seen_by_sequence_numbers_and_a_restart_is_no_loss(tmp_path):
    numbers = [0, 1, 4, 5, 9, 0, 1]
    log = SessionLog(write(tmp_path / "log.lcm", frames(numbers)))
    assert log.channels["R1_MOCAP_POSE"] == ChannelSummary(
        7, 0, 9000, pytest.approx(6 / 0.009), lost=5, gaps=2
    )


@pytest.mark.parametrize(
    ("numbers", "lost", "gaps"),
    [
        ([0, 2, 1, 3], 0, 0),
        ([0, 0, 1, 2, 2], 0, 0),
        ([0, 3, 2, 4, 9, 8], 4, 2),
        ([7, 9, 8, 0, 2], 1, 1),
        ([0, 54, 1, 55, 2, 56], 0, 0),
        ([0, 1, 90, 91, 2, 92, 3, 95, 6], 4, 2),
    ],
    ids=["overtaken", "twice", "overtaken and lost", "started again", "beside", "beside, lost"],
)
def test_what_the_radio_overtakes_or_repeats_is_not_lost(tmp_path, numbers, lost, gaps):
    seen = SessionLog(write(tmp_path / "log.lcm", frames(numbers))).channels["R1_MOCAP_POSE"]
    assert (seen.lost, seen.gaps) == (lost, gaps)


def test_a_board_that_learns_the_time_has_not_lived_longer(tmp_path):
    """Ten messages a second for ten seconds each, before and after its clock jumps by an hour."""
    messages = []
    for number in range(200):
        status = lcmtypes.onboard_status_t()
        status.utime, status.sequence = 100_000 * number, number
        logger = lcmtypes.logger_status_t()
        logger.utime, logger.sequence = status.utime, number
        if number < 100:
            status.utime -= 3_600_000_000
        messages += [
            (row.name("R1"), message.encode(), logger.utime + 500)
            for row, message in ((ONBOARD_STATUS, status), (LOGGER_STATUS, logger))
        ]
    log = SessionLog(write(tmp_path / "log.lcm", messages))
    assert log.channels["R1_ONBOARD_STATUS"].rate_hz == pytest.approx(10.0, rel=1e-3)
    assert log.duration_s == pytest.approx(19.9)


def test_channels_of_other_programs_are_counted_by_arrival(tmp_path):
    log = SessionLog(write(tmp_path / "log.lcm", [("OTHER", b"x" * 50, t) for t in (5, 1_000_005)]))
    assert log.channels["OTHER"] == ChannelSummary(2, 5, 1_000_005, 1.0, 0, 0)
    with pytest.raises(LogError, match="holds no channel of this lab, only OTHER"):
        log.array(MOCAP_POSE)


def test_arrays_hold_every_message(session, path):
    log = SessionLog(path)
    poses = log.array(MOCAP_POSE)
    assert poses["x1_m"].tolist() == [frame.x1_m for frame in session.frames]
    assert poses["tracking_valid"].all()
    assert len(log.array(SAMPLER_STATE)) == len(session.states)
    assert len(log.array(ENCODER)) == 0
    assert log.messages(SESSION_INFO)[0].activity == "calibrate"


def test_the_configuration_comes_out_as_it_went_in(session, path):
    assert SessionLog(path).config() == session.config


def test_a_log_without_or_with_two_configurations_is_refused(session, tmp_path):
    with pytest.raises(LogError, match="R1_SESSION_INFO, so it does not say its configuration"):
        SessionLog(write(tmp_path / "a.lcm", frames([0]))).config()

    def row(text):
        info = lcmtypes.session_info_t()
        info.config_yaml = text
        return SESSION_INFO.name("R1"), info.encode(), 0

    other = row(dump_config(load_config(overrides=["seed=77"])))
    with pytest.raises(LogError, match="2 different configurations"):
        SessionLog(write(tmp_path / "b.lcm", [*session.messages()[:3], other])).config()
    with pytest.raises(ConfigError, match=r"c\.lcm: its configuration is none of this version"):
        SessionLog(write(tmp_path / "c.lcm", [row("seed: 1")])).config()


def test_a_session_that_was_resumed_on_another_bus_has_one_configuration(tmp_path):
    rows = []
    for url in ("udpm://239.255.76.67:7667?ttl=0", "udpm://239.255.76.68:7668?ttl=0"):
        info = lcmtypes.session_info_t()
        info.config_yaml = dump_config(load_config(overrides=[f"bus.url={url}"]))
        rows.append((SESSION_INFO.name("R1"), info.encode(), 0))
    found = SessionLog(write(tmp_path / "a.lcm", rows)).config()
    assert found == load_config(overrides=["bus.url=udpm://239.255.76.67:7667?ttl=0"])


def test_several_robots_in_one_log_are_kept_apart(tmp_path):
    path = write(tmp_path / "log.lcm", frames([0, 1]) + frames([5], "R2"))
    with pytest.raises(LogError, match="holds the robots R1, R2; say which"):
        SessionLog(path).array(MOCAP_POSE)
    assert len(SessionLog(path, robot_name="R1").array(MOCAP_POSE)) == 2
    assert SessionLog(path, robot_name="R2").array(MOCAP_POSE)["sequence"].tolist() == [5]
    with pytest.raises(LogError, match="holds no robot R3, only R1, R2"):
        SessionLog(path, robot_name="R3").array(MOCAP_POSE)


def test_messages_of_another_type_are_refused_and_left_out_by_salvage(tmp_path):
    wrong = ("R1_MOCAP_POSE", lcmtypes.encoder_t().encode(), 0)
    path = write(tmp_path / "log.lcm", [*frames([0, 1]), wrong, *frames([3])])
    with pytest.raises(
        LogError, match=r"1 of 4 messages of R1_MOCAP_POSE are no mocap_pose_t, first number 2"
    ):
        SessionLog(path).array(MOCAP_POSE)
    assert SessionLog(path, salvage=True).array(MOCAP_POSE)["sequence"].tolist() == [0, 1, 3]


def test_messages_too_short_for_a_header_are_only_counted(tmp_path):
    path = write(tmp_path / "log.lcm", [("R1_MOCAP_POSE", b"", 7), *frames([0, 1])])
    assert SessionLog(path).channels["R1_MOCAP_POSE"].count == 3


def test_a_damaged_log_is_refused_and_salvaged_on_request(session, path):
    content = bytearray(path.read_bytes())
    middle = content.index(SYNC, len(content) // 2)
    content[middle : middle + 300] = bytes(300)
    path.write_bytes(content)
    with pytest.raises(LogError, match="--salvage"):
        SessionLog(path)
    log = SessionLog(path, salvage=True)
    missing = len(session.messages()) - sum(c.count for c in log.channels.values())
    assert 3 <= missing <= 6
    assert sum(c.lost for c in log.channels.values()) == missing
    assert len(log.damage) == 1
    assert 300 <= log.damage[0].size < 300 + 2 * 150
    assert np.all(np.diff(log.array(MOCAP_POSE)["utime"]) > 0)
