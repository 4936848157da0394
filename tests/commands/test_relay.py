"""Guests hear the lab on a bus of their own, and nothing of theirs comes back."""

import signal

import lcm
import pytest
from klab import klab, start_klab

import lcmtypes
from koopman_lab.bus.channels import GOAL
from koopman_lab.errors import BusUrlError
from offboard.commands.relay import require_apart

LAB = "udpm://239.255.76.67:7667?ttl=0"
MOST_TRIES = 600
TRIAL = "LCM_SELF_TEST"


@pytest.mark.parametrize(
    "guests",
    [
        "udpm://239.255.76.68:7668?ttl=0",
        "udpm://239.255.76.67:7668",
        "udpm://239.255.76.67:7668?ttl=1&recv_buf_size=1000000",
    ],
)
def test_another_port_is_another_bus(guests):
    require_apart(LAB, guests)


@pytest.mark.parametrize(
    "guests",
    [LAB, "udpm://239.255.76.68:7667?ttl=1", "udpm://", "udpm://?ttl=1"],
)
def test_on_one_port_all_groups_are_one_bus(guests):
    with pytest.raises(BusUrlError, match="take another port, for example 7668"):
        require_apart(LAB, guests)


@pytest.mark.parametrize(
    "guests",
    [
        *("", "memq://", "file:///x.lcm", "tcpq://1.2.3.4:7700", "udpm://10.0.0.1:7700"),
        *("udpm://x:1", "udpm://239.255.76.68", "udpm://:7668?ttl=1"),
    ],
)
def test_what_is_no_bus_of_a_network_is_refused(guests):
    for urls in ((LAB, guests), (guests, LAB)):
        with pytest.raises(BusUrlError, match="expected"):
            require_apart(*urls)


def test_it_is_said_that_there_is_no_other_way(bus_url):
    done = klab("relay", "--to", "udpm://239.255.76.69:7669?ttl=0")
    assert done.returncode == 2
    assert "--read-only" in done.stderr
    done = klab("relay", "--read-only", "--to", bus_url)
    assert done.returncode == 2
    assert "another port" in done.stderr


def encoded(number):
    message = lcmtypes.goal_t()
    message.sequence = number
    return message.encode() + b"and a tag behind it"


def test_guests_hear_every_byte_and_nothing_of_theirs_comes_back(bus_url):
    port = int(bus_url.rpartition(":")[2].partition("?")[0])
    guests_url = f"udpm://239.255.76.69:{port + 10_000}?ttl=0"
    lab, guests, heard, back = lcm.LCM(bus_url), lcm.LCM(guests_url), set(), set()
    guests.subscribe(".*", lambda name, data: heard.add((name, data)))
    lab.subscribe(".*", lambda name, data: back.add((name, data)))
    relay = start_klab("relay", "--read-only", "--to", guests_url)
    try:
        assert "nothing comes back" in relay.stdout.readline()
        said = set()
        for number in range(MOST_TRIES):
            said.add((GOAL.name("R1"), encoded(number)))
            lab.publish(GOAL.name("R1"), encoded(number))
            # What the guests say reaches them all, and not the lab.
            guests.publish(GOAL.name("GUEST"), encoded(number))
            guests.handle_timeout(50)
            lab.handle_timeout(0)
            if len(heard & said) >= 20:
                break
        while guests.handle_timeout(100):
            pass
        while lab.handle_timeout(100):
            pass
    finally:
        relay.send_signal(signal.SIGINT)
        told, _ = relay.communicate(timeout=60)
    assert len(heard & said) >= 20
    # Of LCM itself are the trials of a bus that is opened.
    assert {name for name, _ in heard} - {TRIAL} == {GOAL.name("R1"), GOAL.name("GUEST")}
    assert {name for name, _ in back} - {TRIAL} == {GOAL.name("R1")}
    assert relay.returncode == 0
    assert "messages sent on" in told
