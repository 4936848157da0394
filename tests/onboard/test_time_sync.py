"""How well the board knows the desk's time, and what the robot does with it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests_support import Script, lab_of

from koopman_lab.bus import channels
from koopman_lab.config.load import load_config
from koopman_lab.emulation.drifting_clock import DriftingClock
from koopman_lab.emulation.faults import Faults
from koopman_lab.eventlog.eventlog import read_events
from offboard.logger.node import LoggerNode
from offboard.sampler.node import SamplerNode
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode
from onboard.time_sync import Exchange, TimeSync

CLOCK = load_config().clock
BOARD = load_config().simulation.clock
PERIOD_US = 250_000


class Pair:
    """A desk whose clock is true, a board whose clock is not, and a radio between them."""

    def __init__(self, offset_s, drift_ppm, seed=1, there_s=0.001, back_s=0.001, **changes):
        clock = BOARD.model_copy(update={"offset_s": offset_s, "drift_ppm": drift_ppm})
        self.board = DriftingClock(clock, 0, Faults((), 0))
        self.sync = TimeSync(CLOCK.model_copy(update=changes))
        self.now_us = 0
        self._rng, self._means_us = np.random.default_rng(seed), (1e6 * there_s, 1e6 * back_s)

    def exchange(self, count=1):
        """Ping at the usual rate; delays are 2 ms and exponential jitter with different means."""
        for _ in range(count):
            self.now_us += PERIOD_US
            there, back = (2000 + self._rng.exponential(mean) for mean in self._means_us)
            received = self.now_us + round(there)
            answered = received + 100
            arrived = answered + round(back)
            self.sync.add(
                Exchange(self.board.read(self.now_us), received, answered, self.board.read(arrived))
            )
        return self

    def error_us(self, after_us=0):
        """Return the error of the map at some time, and its bound."""
        desk_us = self.now_us + after_us
        board_us = self.board.read(desk_us)
        return self.sync.to_desk(board_us) - desk_us, self.sync.error_us(board_us)


means = st.floats(1e-6, 0.1)


@settings(max_examples=60)
@given(
    offset_s=st.floats(-1e9, 1e9),
    drift_ppm=st.floats(-100, 100),
    there_s=means,
    back_s=means,
    count=st.integers(1, 300),
    after_s=st.floats(0, 600),
    seed=st.integers(0, 1000),
)
def test_the_error_is_within_its_bound(offset_s, drift_ppm, there_s, back_s, count, after_s, seed):
    """Whatever offset, drift and asymmetric jitter; also long after the last answer."""
    pair = Pair(offset_s, drift_ppm, seed, there_s, back_s).exchange(count)
    error, bound = pair.error_us(round(after_s * 1e6))
    assert abs(error) <= bound
    assert pair.sync.restarts == 0
    true_ppm = (1.0 / (1.0 + drift_ppm * 1e-6) - 1.0) * 1e6
    assert abs(pair.sync.drift * 1e6 - true_ppm) <= pair.sync.drift_error * 1e6 + 1e-9


def test_on_good_wifi_offset_and_drift_are_found():
    pair = Pair(0.25, 40.0).exchange(round(CLOCK.window_s * 1e6 / PERIOD_US))
    error, bound = pair.error_us()
    assert abs(error) < 300
    # The bound cannot fall below half the round trip, of which 4 ms are no jitter.
    assert 2000 <= bound < 3000
    assert pair.sync.drift * 1e6 == pytest.approx(-40.0, abs=3.0)
    assert pair.sync.drift_error * 1e6 < 40.0


@pytest.mark.parametrize(("there_us", "back_us"), [(2000, 2000), (0, 5000), (5000, 0)])
def test_one_exchange_tells_the_offset_within_half_its_round_trip(there_us, back_us):
    sync = TimeSync(CLOCK)
    received = 1_000_000 + there_us
    assert sync.add(Exchange(3_000_000, received, received, 3_000_000 + there_us + back_us))
    assert sync.offset_us(3_000_000) == -2_000_000 + (there_us - back_us) // 2
    half = (there_us + back_us) / 2
    assert half <= sync.error_us(3_000_000) <= half + 5


def test_without_an_answer_both_clocks_are_one():
    sync = TimeSync(CLOCK)
    assert not sync.synced
    assert sync.to_desk(5) == sync.to_board(5) == 5
    assert sync.error_us(5) is None


@pytest.mark.parametrize(
    "exchange",
    [
        Exchange(1000, 0, 0, 900),
        Exchange(0, 500, 400, 1000),
        Exchange(0, 500, 900, 100),
        Exchange(0, 0, 0, 2_000_000),
        Exchange(0, 2**62, 2**62, 100),
    ],
    ids=["backwards", "answered before", "longer there than away", "replayed", "no clock"],
)
def test_answers_that_no_clock_can_have_given_are_not_taken(exchange):
    sync = TimeSync(CLOCK)
    assert not sync.add(exchange)
    assert not sync.synced


@given(st.integers(-(2**50), 2**50), st.floats(-100, 100))
def test_the_map_back_undoes_the_map(desk_us, drift_ppm):
    sync = Pair(-3.0, drift_ppm).exchange(240).sync
    assert abs(sync.to_desk(sync.to_board(desk_us)) - desk_us) <= 1 + abs(desk_us) * 1e-7


def test_a_clock_that_was_set_is_learned_anew():
    pair = Pair(0.25, 40.0).exchange(100)
    pair.board = DriftingClock(BOARD.model_copy(update={"offset_s": 10.0}), 0, Faults((), 0))
    error, bound = pair.exchange(1).error_us()
    assert abs(error) <= bound < 10_000
    assert (pair.sync.restarts, pair.sync.exchanges) == (1, 1)


class Ear:
    """Hears what a test asks for, at the desk."""

    name = "logger"

    def __init__(self, *rows):
        self.rows, self.heard = rows, {channel.suffix: [] for channel in rows}

    def attach(self, port):
        for channel in self.rows:
            heard = self.heard[channel.suffix]
            port.subscribe(channel, lambda m, heard=heard: heard.append((port.now_us(), m)))

    def close(self):
        pass


def drive(seconds, *overrides):
    """Drive the robot in lockstep; return the onboard node and what the desk heard."""
    config = load_config(overrides=overrides)
    onboard = OnboardNode(config)
    ear = Ear(channels.WHEEL_STATE, channels.ONBOARD_STATUS, channels.TIME_SYNC)
    lab = lab_of(config, PlantNode(config), onboard, ear, Script(config, (0.2, 0.1)))
    lab.run(seconds)
    return onboard, ear.heard


@pytest.mark.parametrize("offset_s", [0.25, -0.25, 1e6, -1e6])
def test_whatever_the_board_believes_it_drives_and_speaks_in_the_desks_time(offset_s):
    onboard, heard = drive(
        *(
            8.0,
            f"simulation.clock.offset_s={offset_s}",
            "simulation.clock.drift_ppm=-80",
            "simulation.radio.to_robot.loss=0",
        ),
    )
    counts = onboard.loop.arbiter.counts
    # A board whose clock is far off refuses commands until the first answer.
    assert counts.refused["stale"] <= (0 if abs(offset_s) < 0.5 else 6)
    assert counts.accepted >= 8.0 * 20 - 8
    for now_us, status in heard["ONBOARD_STATUS"][10:]:
        assert -3000 <= now_us - status.utime <= 20_000
    for now_us, wheels in heard["WHEEL_STATE"][20:]:
        # The window is centred 25 ms back, and its newest reading up to a tick old.
        assert 22_000 <= now_us - wheels.utime <= 60_000
    for now_us, sync in heard["TIME_SYNC"]:
        true_us = -round(offset_s * 1e6) - round(now_us * -80e-6)
        assert abs(sync.offset_us - true_us) <= sync.error_us + 1


def test_a_replayed_command_is_stale_by_the_boards_map():
    onboard, _ = drive(2.0, "simulation.clock.offset_s=1e6")
    counts, lifetime_s = onboard.loop.arbiter.counts, load_config().motor_loop.command_lifetime_s
    for age_s, refused in ((lifetime_s + 0.01, 1), (lifetime_s - 0.01, 0)):
        message, before = channels.VELOCITY_CMD.type(), counts.refused["stale"]
        message.utime = 2_000_000 - round(age_s * 1e6)
        message.commander, message.sequence = 2, 10**6
        onboard._on_command("", message.encode(), onboard._port.now_us())
        assert counts.refused["stale"] - before == refused


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_calibration_is_complete_and_its_log_a_function_of_the_seed(robot, tmp_path):
    def calibrate(name, seed):
        config = load_config(
            robot=robot,
            overrides=[
                *("simulation.clock.offset_s=-30", "simulation.clock.drift_ppm=90", f"seed={seed}"),
                *("sampler.segments_per_basis=1", "sampler.largest_steps=20"),
            ],
        )
        path, sampler = tmp_path / name, SamplerNode(config)
        standing = PlantNode(config), OnboardNode(config), LoggerNode(config, path)
        lab = lab_of(config, *standing, sampler)
        assert lab.run(300.0)
        lab.close()
        assert sampler.outcome().complete
        return path

    first, same, other = calibrate("a", 1), calibrate("b", 1), calibrate("c", 2)
    assert first.read_bytes() == same.read_bytes()
    assert first.read_bytes() != other.read_bytes()
    assert {"R1_TIME_PING", "R1_TIME_PONG", "R1_TIME_SYNC"} <= {
        e.channel for e in read_events(first)
    }
