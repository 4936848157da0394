"""Real processes over real UDP multicast."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.multicast import bus_url, open_lcm, route_remedy
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.errors import BusError

PROGRAM = """
import sys
from koopman_lab.bus.realtime import run_node
from koopman_lab.config.load import parse_config
from onboard.plant.node import PlantNode
config = parse_config(sys.argv[1], "test")
run_node(PlantNode(config), config, lifeline_fd=int(sys.argv[2]))
"""
MOST_WAITS = 400
WAIT_S = 0.05


@pytest.fixture
def config(bus_url):
    return load_config(overrides=[f"bus.url={bus_url}"])


@pytest.fixture
def plant(config):
    """Start a plant; yield its process, and the end of its lifeline that keeps it alive."""
    read, write = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, dump_config(config), str(read)], pass_fds=[read]
    )
    os.close(read)
    lifeline = os.fdopen(write, "wb")
    yield process, lifeline
    lifeline.close()
    process.kill()
    process.wait()


def listen(config, *rows):
    """Return a listener and the lists its messages go into."""
    listener, heard = Listener(config), {}
    for channel in rows:
        heard[channel.suffix] = []
        listener.subscribe(channel, heard[channel.suffix].append)
    return listener, heard


def wait_for(listener, condition):
    silent = 0
    while not condition():
        silent += not listener.spin(WAIT_S)
        assert silent < MOST_WAITS, "did not happen in time"


def test_a_plant_process_keeps_its_rates_and_loses_nothing(config, plant):
    listener, heard = listen(
        config, channels.MOCAP_POSE, channels.ENCODER, channels.HEARTBEATS["plant"]
    )
    poses = heard["MOCAP_POSE"]
    wait_for(listener, lambda: len(poses) >= 480)
    numbers = [m.sequence for m in poses]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    seconds = (poses[-1].utime - poses[0].utime) * 1e-6
    skipped = heard["PLANT_HEARTBEAT"][-1].missed_ticks
    assert (len(poses) - 1) / 240.0 <= seconds + 0.02
    assert seconds <= (len(poses) + skipped + 4) / 240.0
    assert heard["PLANT_HEARTBEAT"][-1].pid == plant[0].pid


def test_the_thread_that_receives_goes_before_others_like_the_one_that_computes(config, plant):
    listener, heard = listen(config, channels.HEARTBEATS["plant"])
    wait_for(listener, lambda: heard["PLANT_HEARTBEAT"])
    threads = [int(task.name) for task in Path(f"/proc/{plant[0].pid}/task").iterdir()]
    assert len(threads) > 1
    assert len({os.sched_getscheduler(thread) for thread in threads}) == 1
    assert len({os.sched_getparam(thread).sched_priority for thread in threads}) == 1


@pytest.mark.usefixtures("plant")
def test_it_hears_what_is_sent_to_it(config):
    listener, heard = listen(config, channels.MOCAP_POSE)
    wait_for(listener, lambda: heard["MOCAP_POSE"])

    def placed():
        reset = lcmtypes.plant_reset_t()
        reset.utime, reset.x1_m = listener.now_us(), 3.0
        listener.publish(channels.PLANT_RESET, reset)
        return heard["MOCAP_POSE"][-1].x1_m > 2.9

    wait_for(listener, placed)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_in_order(config, plant, number):
    listener, heard = listen(config, channels.MOCAP_POSE)
    wait_for(listener, lambda: heard["MOCAP_POSE"])
    plant[0].send_signal(number)
    assert plant[0].wait(timeout=10) == 0


def test_the_end_of_the_lifeline_ends_it(config, plant):
    listener, heard = listen(config, channels.MOCAP_POSE)
    wait_for(listener, lambda: heard["MOCAP_POSE"])
    plant[1].close()
    assert plant[0].wait(timeout=10) == 0


def test_a_listener_hears_only_its_own_robot(config):
    other = config.model_copy(update={"robot": config.robot.model_copy(update={"name": "R1X"})})
    listener, heard = listen(config, channels.ENCODER)
    speaker = Listener(other)
    own = Listener(config)

    def heard_own():
        speaker.publish(channels.ENCODER, lcmtypes.encoder_t())
        own.publish(channels.ENCODER, lcmtypes.encoder_t())
        return len(heard["ENCODER"]) >= 3

    wait_for(listener, heard_own)
    numbers = [m.sequence for m in heard["ENCODER"]]
    assert numbers == sorted(set(numbers))


@pytest.mark.parametrize(
    ("url", "said"),
    [
        # Nobody listens on the discard port of this machine.
        ("tcpq://127.0.0.1:9", "lcm-tcpq-server"),
        ("nonsense://", "expected udpm://"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_explained(url, said):
    with pytest.raises(BusError, match=said):
        open_lcm(load_config(overrides=[f"bus.url={url}"]))


def test_a_port_that_another_program_holds_is_explained_however_often_one_asks():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("0.0.0.0", 0))
        url = f"udpm://239.255.76.67:{holder.getsockname()[1]}?ttl=0"
        deaf = Listener(load_config(overrides=[f"bus.url={url}"]))
        for channel in (channels.ESTOP, channels.ENCODER):
            with pytest.raises(BusError, match=r"not listen: a program .* another port"):
                deaf.subscribe(channel, lambda _: None)
            with pytest.raises(BusError, match="not listen"):
                deaf.spin(0.0)
            with pytest.raises(BusError, match="not listen"):
                deaf.overhear(lambda *_: None)


@pytest.mark.parametrize(
    ("url", "interface"),
    [
        ("udpm://239.255.76.67:7667?ttl=0", "lo"),
        ("udpm://239.255.76.67:7667", "lo"),
        ("udpm://239.255.76.67:7667?recv_buf_size=1&ttl=1", "eth0"),
    ],
)
def test_the_route_that_is_missing_is_that_to_whoever_shall_hear(url, interface):
    assert f"dev {interface}" in route_remedy(url)


def test_the_receive_buffer_is_asked_for():
    assert bus_url(load_config()).endswith("?ttl=0&recv_buf_size=2097152")
    assert bus_url(load_config(overrides=["bus.url=memq://"])) == "memq://"
