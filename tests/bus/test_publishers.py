"""Who speaks on a stream: against streams of which the test knows who speaks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from speakers import Ear, Said, by_radio, speak
from tests_support import Script, lab_of

from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.publishers import NamedIdentity, StreamIdentity, identity_faults
from koopman_lab.bus.sequence import LATEST
from koopman_lab.config.load import load_config
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

CONFIG = load_config()
RATES_HZ = [2.0, 10.0, 20.0, 100.0, 240.0]
BAD = {
    **{"delay_s": 0.003, "jitter_s": 0.002, "duplication": 0.05},
    **{"reordering": 0.05, "held_back_s": 0.02},
}
phases = st.floats(0.02, 0.98)
numbers = st.one_of(st.integers(0, 8), st.integers(0, 200), st.integers(0, 10**12))


def settled_us(rate_hz):
    """Return after which time together two are known, and after which silence forgotten."""
    return round(1e6 * max(1.0, 7.0 / rate_hz))


@given(
    st.sampled_from(RATES_HZ), st.sampled_from([1.0, 1.013, 0.5]), phases, numbers, numbers,
    st.sampled_from([0, -30_000_000, 3_600_000_000]),
)  # fmt: skip
def test_two_that_speak_at_once_are_two_while_they_do(
    rate_hz, ratio, phase, first, second, clock_us
):
    joins_us, seconds = round(1e6 * (4.0 + phase) / rate_hz), 30.0 / rate_hz
    one = speak(rate_hz, 4 * seconds, first=first)
    other = speak(rate_hz * ratio, seconds, first=second, start_us=joins_us, clock_us=clock_us)
    ear = Ear(one, other)
    known_us = joins_us + settled_us(rate_hz * ratio)
    leaves_us = other[-1].arrived_us
    together = {i.publishers for at, i in ear.heard if known_us <= at <= leaves_us}
    assert together <= {2}
    assert ear.counts() <= {1, 2}
    assert ear.publishers.identity(leaves_us + 2 * settled_us(rate_hz * ratio)).clear


@given(st.integers(2, 6), st.integers(0, 3), st.integers(1, 600))
def test_as_many_are_counted_as_speak(count, apart, step_us):
    streams = [speak(240.0, 2.0, first=apart * k, start_us=k * step_us) for k in range(count)]
    assert Ear(*streams).counts(after_us=1_000_000) == {count}


@given(
    st.sampled_from(RATES_HZ), st.integers(0, 2**32), st.floats(0.0, 0.05), st.floats(0.0, 3.0),
    st.lists(st.floats(0.5, 8.0), max_size=3), numbers,
)  # fmt: skip
def test_one_is_one_whatever_the_radio_does_and_however_often_it_starts_again(
    rate_hz, seed, held_back_s, bursts_hz, lives_s, first
):
    said, start_us = [], 0
    for life_s in (*lives_s, 400.0 / rate_hz):
        said += speak(rate_hz, life_s, first=first, start_us=start_us)
        start_us, first = start_us + round(1e6 * life_s) + 600_000, 0
    bad = BAD | {"held_back_s": held_back_s, "burst_rate_hz": bursts_hz, "burst_s": 0.2}
    ear = Ear(by_radio(said, seed, **bad))
    assert (ear.counts(), ear.numberings()) == ({1}, {"counts"})


@given(st.integers(0, 2**32), numbers, numbers)
def test_two_are_seen_through_a_bad_radio_as_well(seed, first, second):
    one = by_radio(speak(20.0, 20.0, first=first), seed, **BAD, loss=0.1)
    other = by_radio(speak(20.0, 20.0, first=second, start_us=17_000), seed + 1, **BAD, loss=0.1)
    # One a little ahead seems to have lost, and the other to be overtaken, until it catches up.
    assert 1 not in Ear(one, other).counts(after_us=round(1e6 * (LATEST / 20.0 + 2.0)))


def frames(*numbers_of_frame):
    """Return 5 s of cameras that number their frames so."""
    return [
        Said(4167 * k + 200 * copy, number(k), 4167 * k)
        for k in range(1200)
        for copy, number in enumerate(numbers_of_frame)
    ]


@pytest.mark.parametrize(
    ("said", "numbering"),
    [
        (frames(lambda _: 0), "stands still"),
        (frames(lambda k: min(k, 700)), "stands still"),
        (frames(lambda k: 10**6 - k), "starts again"),
        (frames(lambda k: k * 7919 % 10_007), "starts again"),
        (frames(lambda k: 2 * k, lambda k: 2 * k + 1), "repeats"),
        (frames(*(lambda k, n=n: 3 * k + n for n in range(3))), "repeats"),
        (frames(lambda k: k, lambda k: k), "repeats"),
    ],
    ids=["never set", "stuck", "backwards", "random", "twice", "three times", "copied"],
)
def test_numbers_that_do_not_count_are_said_within_a_second_and_are_no_second_publisher(
    said, numbering
):
    ear = Ear(said)
    assert ear.publishers.identity(ear.heard[-1][0]) == StreamIdentity(1, numbering)
    wrong_from_us = 4167 * 700 if said[-1].sequence == 700 else 0
    assert {i.numbering for at, i in ear.heard if at > wrong_from_us + 1_000_000} == {numbering}
    # Mended, it is clear again, whatever its next number.
    for first in (0, 5000):
        mended = speak(240.0, 4.0, first=first, start_us=10_000_000)
        assert Ear(said, mended).publishers.identity(mended[-1].arrived_us).clear


def test_one_that_does_not_count_beside_one_that_does_is_a_second_publisher():
    assert Ear(frames(lambda k: 900 + k, lambda _: 0)).counts(after_us=1_000_000) == {2}


class Talker:
    """Speaks a channel at 100 Hz under any node's name, from some time on."""

    def __init__(self, channel, name="plant", from_us=0):
        self.channel, self.name, self.from_us = channel, name, from_us

    def attach(self, port):
        self.port = port
        port.every(100.0, self.on_tick)

    def on_tick(self, tick_us):
        if tick_us >= self.from_us:
            message = self.channel.type()
            message.utime = self.port.now_us()
            self.port.publish(self.channel, message)

    def close(self):
        pass


class Hearer:
    name = "onboard"

    def attach(self, port):
        self.port = port
        port.subscribe(channels.ENCODER, lambda _: None)

    def close(self):
        pass


def test_a_node_asks_its_port_also_on_an_emulated_board():
    hearer = Hearer()
    nodes = (Talker(channels.ENCODER), hearer, Talker(channels.ENCODER, from_us=2_000_000))
    lab = lab_of(load_config(preset="lab"), *nodes)
    lab.run(1.9)
    assert hearer.port.publishers(channels.ENCODER) == StreamIdentity(1, "counts")
    lab.run(1.0)
    assert hearer.port.publishers(channels.ENCODER) == StreamIdentity(2, "counts")
    assert hearer.port.publishers(channels.MOCAP_POSE) == StreamIdentity(1, "counts")


def test_two_that_tick_together_in_lockstep_are_not_clear():
    """Equal numbers and equal stamps: copies, as far as anybody can tell."""
    lab, hearer = Lockstep(CONFIG), Hearer()
    for node in (Talker(channels.ENCODER), hearer, Talker(channels.ENCODER)):
        lab.add(node)
    lab.run(1.0)
    assert hearer.port.publishers(channels.ENCODER) == StreamIdentity(1, "repeats")


def test_what_comes_from_hardware_cameras_and_board_has_one_publisher():
    one = {channel.suffix for channel in channels.CHANNELS if channel.has_one_publisher}
    assert one == {
        *("MOCAP_POSE", "ENCODER", "PLANT_TRUTH", "MOTOR_CMD", "WHEEL_STATE", "ONBOARD_STATUS"),
        *("TIME_PING", "TIME_SYNC", "PLANT_HEARTBEAT", "ONBOARD_HEARTBEAT"),
        *("DRIVER_HEARTBEAT", "MOCAP_HEARTBEAT"),
    }


def heard(channel, identity, robot_name="R1", rate_hz=None):
    nominal_hz = channel.rate_hz(CONFIG)
    return NamedIdentity(channel.name(robot_name), channel, identity, rate_hz, nominal_hz)


def test_words_name_channel_number_rate_and_what_to_look_for():
    two = StreamIdentity(2)
    assert identity_faults([heard(channels.MOCAP_POSE, two, rate_hz=480.3)]) == [
        "R1_MOCAP_POSE (480 of 240 Hz): 2 publishers; a second camera bridge uses the name R1: "
        "stop it, or give it another --robot-name than R1"
    ]
    both = [heard(channels.MOCAP_POSE, two), heard(channels.ONBOARD_STATUS, two)]
    (line,) = identity_faults(both)
    assert line.startswith(
        "R1_MOCAP_POSE, R1_ONBOARD_STATUS: 2 publishers; a second camera bridge "
    )
    assert "camera bridge or onboard program uses the name R1" in line
    assert len(identity_faults([*both, heard(channels.ENCODER, two, "R2")])) == 2


@pytest.mark.parametrize(
    ("numbering", "words"),
    [
        ("stands still", "sequence does not count"),
        ("starts again", "sequence begins again"),
        ("repeats", "each message comes more than once"),
    ],
)
def test_each_numbering_has_its_words(numbering, words):
    (line,) = identity_faults([heard(channels.MOCAP_POSE, StreamIdentity(1, numbering))])
    assert line.startswith("R1_MOCAP_POSE: ")
    assert words in line


def test_nothing_is_said_of_clear_streams_and_of_those_on_which_several_may_speak():
    several = StreamIdentity(3, "stands still")
    for channel in (channels.ESTOP, channels.LOGGER_STATUS, channels.VELOCITY_CMD):
        assert not identity_faults([heard(channel, several)])
    assert not identity_faults([heard(channels.MOCAP_POSE, StreamIdentity())])


class Doubter:
    """Asks twice a second who speaks on every channel that may have one publisher only."""

    name = "logger"

    def __init__(self):
        self.lines, self.asked = [], 0

    def attach(self, port):
        self.port = port
        self.channels = [channel for channel in channels.CHANNELS if channel.has_one_publisher]
        for channel in self.channels:
            port.subscribe_raw(channel, lambda *_: None)
        port.every(2.0, self.on_tick)

    def on_tick(self, _):
        identities = [heard(c, self.port.publishers(c)) for c in self.channels]
        self.lines += identity_faults(identities)
        self.asked += len(identities)

    def close(self):
        pass


@pytest.mark.parametrize("preset", ["ideal", "lab", "harsh"])
def test_no_stream_of_a_simulated_robot_is_doubted_also_by_a_radio_that_doubles_and_exchanges(
    preset,
):
    radio = "{duplication: 0.05, reordering: 0.05, burst_rate_hz: 0.2, burst_s: 0.1}"
    config = load_config(
        preset=preset,
        overrides=[f"simulation.radio.{way}={radio}" for way in ("to_robot", "from_robot")],
    )
    doubter = Doubter()
    lab = lab_of(
        config, PlantNode(config), OnboardNode(config), doubter, Script(config, (0.1, 0.5))
    )
    lab.run(60.0)
    assert (doubter.lines, doubter.asked) == ([], 121 * len(doubter.channels))


@pytest.mark.parametrize(
    ("lie", "words"),
    [
        ("sequence_stuck", "sequence does not count"),
        ("frames_doubled", "each message comes more than once"),
    ],
)
def test_cameras_that_number_wrongly_are_named_while_they_do(lie, words):
    planned = f"simulation.faults=[{{kind: {lie}, at_s: 5, duration_s: 5}}]"
    config, doubter = load_config(preset="lab", overrides=[planned]), Doubter()
    lab = lab_of(config, PlantNode(config), OnboardNode(config), doubter)
    lab.run(5.0)
    assert not doubter.lines
    lab.run(4.9)
    assert len(doubter.lines) >= 8
    assert all(line.startswith("R1_MOCAP_POSE: ") and words in line for line in doubter.lines)
    lab.run(1.1)
    doubter.lines.clear()
    lab.run(20.0)
    assert not doubter.lines
