import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests_support import lab_of

from koopman_lab.bus import channels
from koopman_lab.bus.realtime import run_node
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import RadioLink
from koopman_lab.emulation.board import emulated_board
from koopman_lab.emulation.radio import Radio

PERFECT = dict.fromkeys(RadioLink.model_fields, 0.0)
PERIOD_US = 10_000
MANY = 20_000
shares = st.sampled_from([0.0, 0.1, 1.0])
seconds = st.sampled_from([0.0, 0.001, 0.05])


def send(count=MANY, seed=1, start_us=0, **settings):
    """Send regularly through one direction; return the arrivals of each message."""
    radio = Radio(RadioLink(**(PERFECT | settings)), np.random.default_rng(seed))
    return [radio.arrivals(start_us + k * PERIOD_US) for k in range(count)]


def delays_us(arrivals):
    return np.array([copies[0] - k * PERIOD_US for k, copies in enumerate(arrivals) if copies])


def test_a_perfect_radio_is_not_there():
    assert send(100) == [(k * PERIOD_US,) for k in range(100)]


def test_delay_is_constant_and_jitter_exponential_on_top():
    assert set(delays_us(send(100, delay_s=0.003))) == {3000}
    jittered = delays_us(send(delay_s=0.002, jitter_s=0.001))
    assert jittered.min() >= 2000
    assert jittered.mean() == pytest.approx(3000, rel=0.03)
    assert jittered.std() == pytest.approx(1000, rel=0.05)


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_loss_and_duplication_have_their_shares(share):
    lost = sum(not copies for copies in send(loss=share))
    twice = sum(len(copies) == 2 for copies in send(duplication=share))
    assert lost == pytest.approx(share * MANY, rel=0.1)
    assert twice == pytest.approx(share * MANY, rel=0.1)


@pytest.mark.parametrize(("own", "fault", "share"), [(0.0, 0.3, 0.3), (0.4, 0.3, 0.4), (0.4, 1, 1)])
def test_a_fault_loses_its_share_if_that_is_more_than_the_radios_own(own, fault, share):
    radio = Radio(RadioLink(**(PERFECT | {"loss": own})), np.random.default_rng(1))
    lost = sum(not radio.arrivals(k * PERIOD_US, fault) for k in range(MANY))
    assert lost == pytest.approx(share * MANY, rel=0.1)


def test_only_what_is_held_back_is_overtaken():
    kept = [copies[0] for copies in send(jitter_s=0.02)]
    assert kept == sorted(kept)
    held = delays_us(send(reordering=0.1, held_back_s=0.025))
    assert set(held) == {0, 25_000}
    assert (held > 0).mean() == pytest.approx(0.1, rel=0.1)


def test_bursts_lose_messages_in_a_row_for_their_share_of_time():
    lost = np.array([not copies for copies in send(burst_rate_hz=0.5, burst_s=0.5)])
    # Pauses of 2 s and bursts of 0.5 s on average.
    assert lost.mean() == pytest.approx(0.2, rel=0.3)
    after_a_loss = lost[1:][lost[:-1]]
    assert after_a_loss.mean() == pytest.approx(np.exp(-PERIOD_US / 0.5e6), abs=0.01)


@given(shares, shares, shares, seconds, seconds, st.integers(0, 5), st.integers(0, 2**50))
def test_nothing_arrives_before_it_was_sent_and_one_seed_gives_one_fate(
    loss, duplication, reordering, delay_s, jitter_s, seed, start_us
):
    settings = {
        **{"loss": loss, "duplication": duplication, "reordering": reordering},
        **{"delay_s": delay_s, "jitter_s": jitter_s, "held_back_s": 0.02},
        **{"burst_rate_hz": 1.0, "burst_s": 0.1},
    }
    arrivals = send(50, seed, start_us, **settings)
    for k, copies in enumerate(arrivals):
        sent_us = start_us + k * PERIOD_US
        assert all(at_us >= sent_us + round(delay_s * 1e6) for at_us in copies)
    assert arrivals == send(50, seed, start_us, **settings)


class Speaker:
    """Sends one type on a channel at 100 Hz, under any node's name, and hears others."""

    def __init__(self, name, says, hears):
        self.name, self._says, self._hears, self.heard = name, says, hears, {}

    def attach(self, port):
        self.port = port
        for channel in self._says:
            port.every(100.0, lambda t, channel=channel: self._say(channel, t))
        for channel in self._hears:
            port.subscribe(channel, self._note(channel.suffix))

    def _note(self, suffix):
        heard = self.heard[suffix] = []
        return lambda m: heard.append((self.port.now_us() - m.utime, m.sequence))

    def _say(self, channel, tick_us):
        message = channel.type()
        message.utime = tick_us
        self.port.publish(channel, message)

    def close(self):
        pass


def converse(*overrides):
    """Let plant, board and desk speak for 10 s; return what each heard."""
    link = "{delay_s: 0.003, jitter_s: 0, loss: 0.25}"
    config = load_config(
        overrides=[
            *(
                f"simulation.radio.to_robot={link}",
                "simulation.radio.from_robot={delay_s: 0.001, jitter_s: 0}",
            ),
            *("simulation.clock.offset_s=0", "simulation.clock.drift_ppm=0"),
            *overrides,
        ]
    )
    nodes = (
        Speaker("plant", [channels.ENCODER, channels.MOCAP_POSE], [channels.MOTOR_CMD]),
        Speaker(
            "onboard",
            [channels.MOTOR_CMD, channels.WHEEL_STATE],
            [channels.ENCODER, channels.VELOCITY_CMD],
        ),
        Speaker("sampler", [channels.VELOCITY_CMD], [channels.WHEEL_STATE, channels.MOCAP_POSE]),
    )
    lab = lab_of(config, *nodes)
    lab.run(10.0)
    heard = {}
    for node in nodes:
        heard |= {(node.name, suffix): messages for suffix, messages in node.heard.items()}
    return heard, nodes


def test_in_lockstep_only_what_passes_between_board_and_desk_crosses_the_radio():
    heard, (_, board, desk) = converse()
    for untouched in (
        *(("onboard", "ENCODER"), ("plant", "MOTOR_CMD")),
        ("sampler", "MOCAP_POSE"),
    ):
        assert {age for age, _ in heard[untouched]} == {0}
        assert len(heard[untouched]) == 1001
    assert {age for age, _ in heard["sampler", "WHEEL_STATE"]} == {1000}
    commands = heard["onboard", "VELOCITY_CMD"]
    assert {age for age, _ in commands} == {3000}
    assert 650 < len(commands) < 850
    assert board.port.lost_messages()["R1_VELOCITY_CMD"] == (
        commands[-1][1] - commands[0][1] + 1 - len(commands)
    )
    assert desk.port.lost_messages()["R1_MOCAP_POSE"] == 0


def test_in_lockstep_the_seed_and_the_robots_name_decide():
    first = converse()[0]
    assert first == converse()[0]
    for other in ("seed=2", "robot.name=R2"):
        assert first != converse(other)[0]


def test_in_real_time_the_node_itself_waits_for_what_is_under_way(bus_url):
    """A board that hears its own words: both directions delay them, none is lost."""
    link = "{delay_s: 0.05, jitter_s: 0.01, loss: 0.0}"
    config = load_config(
        overrides=[
            f"bus.url={bus_url}",
            f"simulation.radio.to_robot={link}",
            f"simulation.radio.from_robot={link}",
        ]
    )
    board = Speaker("onboard", [channels.WHEEL_STATE], [channels.WHEEL_STATE])
    say = board._say

    def until_enough(channel, tick_us):
        say(channel, tick_us)
        if len(board.heard["WHEEL_STATE"]) >= 20:
            board.port.finish()

    board._say = until_enough
    assert run_node(board, config, wrap=emulated_board(config)).lost_messages == 0
    assert all(age >= 100_000 for age, _ in board.heard["WHEEL_STATE"])
    assert [number for _, number in board.heard["WHEEL_STATE"]][:20] == list(range(20))
