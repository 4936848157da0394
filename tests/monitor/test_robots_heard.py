"""Which robots an order to all of them goes to."""

import pytest

import lcmtypes
from koopman_lab.bus.channels import ESTOP, LOGGER_STATUS, MOCAP_POSE, ONBOARD_STATUS
from offboard.monitor.robots_heard import RobotsHeard

NOW_US = 1_700_000_000_000_000
S = 1_000_000


def say(heard, robot_name, channel=ONBOARD_STATUS, at_us=NOW_US, stamped_us=None, **fields):
    message = channel.type()
    message.utime = at_us if stamped_us is None else stamped_us
    for name, value in fields.items():
        setattr(message, name, value)
    heard.take(channel.name(robot_name), message.encode(), at_us)


def test_every_robot_is_heard_however_many_there_are_and_whatever_it_is_called():
    heard, names = RobotsHeard(), [f"R{k}" for k in range(700)] + ["arm[/0]", "7", "a b"]
    for name in names:
        say(heard, name, MOCAP_POSE)
    assert heard.live(NOW_US) == sorted(names)


def test_orders_of_persons_and_what_is_no_message_make_no_robot():
    heard = RobotsHeard()
    say(heard, "R1", ESTOP)
    heard.take("R2_MOCAP_POSE", b"nonsense", NOW_US)
    heard.take("HELLO", b"", NOW_US)
    assert heard.live(NOW_US) == []


def test_the_motor_loop_speaks_for_a_second():
    heard = RobotsHeard()
    say(heard, "R1", state=lcmtypes.onboard_status_t.ESTOP)
    say(heard, "R2", LOGGER_STATUS)
    assert heard.status("R1", NOW_US + S // 2).state == lcmtypes.onboard_status_t.ESTOP
    assert heard.status("R1", NOW_US + 2 * S) is None
    assert heard.status("R2", NOW_US) is None
    assert heard.status("R3", NOW_US) is None


@pytest.mark.parametrize("also_live", [False, True])
def test_a_replay_is_no_robot_and_hides_none(also_live):
    heard = RobotsHeard()
    for k in range(20):
        at_us = NOW_US + k * S // 10
        say(heard, "R1", MOCAP_POSE, at_us, at_us - 3600 * S)
        if also_live:
            say(heard, "R2", MOCAP_POSE, at_us)
    end_us = NOW_US + 2 * S
    assert heard.live(end_us) == (["R2"] if also_live else [])
    assert heard.replayed(end_us) == ["R1"]


def test_a_board_whose_clock_is_wrong_is_a_robot():
    heard = RobotsHeard()
    for k in range(20):
        at_us = NOW_US + k * S // 10
        say(heard, "R1", ONBOARD_STATUS, at_us, at_us - 3600 * S)
    assert heard.live(NOW_US + 2 * S) == ["R1"]
