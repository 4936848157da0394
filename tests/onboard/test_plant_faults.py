"""What the hardware does when something goes wrong with it; no bus."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.geometry.planar import Pose
from koopman_lab.units import wrap_counter
from onboard.plant.cameras.cameras import Cameras
from onboard.plant.counters import Counters
from onboard.plant.faulty_plant import FaultyPlant
from onboard.plant.plant import Plant
from onboard.plant.wiring import AS_INTENDED, Wiring

TICK_US = 10_000


class Bench:
    def __init__(self, preset, *planned):
        config = load_config(preset=preset, overrides=[f"simulation.faults=[{', '.join(planned)}]"])
        self.plant = Plant(config, np.random.default_rng(0))
        self.hardware = FaultyPlant(config, self.plant, 0)
        self.now_us = 0

    def drive(self, seconds, duty=0.4):
        for _ in range(round(seconds * 100)):
            self.hardware.drive(duty, duty, self.now_us)
            self.now_us += TICK_US
            self.hardware.advance(self.now_us)
        return self.plant.drives.left_rad_per_s, self.plant.drives.right_rad_per_s

    def inject(self, kind, **details):
        self.hardware.faults.inject(Fault(kind=kind, **details), self.now_us)
        self.hardware.advance(self.now_us)


@pytest.mark.parametrize("preset", ["ideal", "lab", "harsh"])
@pytest.mark.parametrize("wheel", ["left", "right"])
def test_a_stalled_motor_stands_while_it_lasts_and_the_other_turns(preset, wheel):
    bench = Bench(preset)
    before = bench.drive(0.5)
    assert min(before) > 5.0
    bench.inject("motor_stalled", wheel=wheel, duration_s=0.5)
    stalled = bench.drive(0.3) if wheel == "left" else bench.drive(0.3)[::-1]
    assert stalled[0] == 0.0
    assert stalled[1] > 5.0
    bench.drive(0.2)
    assert bench.drive(0.5) == pytest.approx(before, rel=0.05)


@pytest.mark.parametrize("preset", ["ideal", "lab"])
def test_a_low_battery_shows_its_voltage_whatever_the_load(preset):
    bench = Bench(preset, "{kind: battery_low, at_s: 0.3, duration_s: 0.3, battery_v: 5.5}")
    bench.drive(0.25)
    healthy_v = bench.plant.battery_v()
    bench.drive(0.15)
    assert bench.plant.battery_v() == 5.5
    bench.drive(0.3)
    assert bench.plant.battery_v() == pytest.approx(healthy_v, abs=0.3)
    assert healthy_v > 6.5


@pytest.mark.parametrize("preset", ["ideal", "lab", "harsh"])
def test_drivers_that_hear_nothing_brake_after_their_timeout(preset):
    """As after a `kill -9` of the onboard program, when nobody else can stop the motors."""
    bench = Bench(preset)
    bench.drive(0.5)
    # The last command was given at the beginning of the last tick.
    bench.hardware.advance(bench.now_us + 80_000)
    assert bench.plant.body_velocity()[0] > 0.15
    bench.now_us += 600_000
    bench.hardware.advance(bench.now_us)
    assert bench.plant.body_velocity() == (0.0, 0.0)
    assert bench.drive(0.5)[0] > 5.0


def test_a_stuck_counter_misses_what_passes_and_then_counts_on():
    counters = Counters()
    assert counters.read((100, 200), AS_INTENDED) == (100, 200)
    assert counters.read((110, 220), Wiring(left=0)) == (100, 220)
    assert counters.read((130, 240), Wiring(left=0, right=0)) == (100, 220)
    assert counters.read((140, 250), Wiring(right=0)) == (110, 220)
    assert counters.read((150, 260), AS_INTENDED) == (120, 230)


def test_counters_go_on_from_where_they_are_when_their_wiring_changes():
    counters = Counters()
    assert counters.read((100, 200), AS_INTENDED) == (100, 200)
    assert counters.read((101, 220), Wiring(left=-1)) == (99, 220)
    assert counters.read((102, 240), Wiring(exchanged=True)) == (119, 221)
    assert counters.read((103, 260), Wiring(right=-1, exchanged=True)) == (99, 222)
    assert counters.read((104, 280), AS_INTENDED) == (100, 242)


@given(
    st.integers(-(2**31), 2**31 - 1),
    st.lists(st.tuples(st.integers(-999, 999), st.integers(-1, 1))),
)
def test_counters_wrap_whatever_came_through_their_wiring(start, steps):
    counters, true, shown = Counters(), start, start
    counters.read((true, true), AS_INTENDED)
    for change, sign in steps:
        true = wrap_counter(true + change)
        shown = wrap_counter(shown + sign * change)
        assert counters.read((true, true), Wiring(sign, sign)) == (shown, shown)


def test_a_hidden_robot_is_not_seen_and_the_noise_of_later_frames_is_the_same():
    config = load_config()
    open_view, hidden = (
        Cameras(config.simulation.cameras, np.random.default_rng(1)) for _ in range(2)
    )
    for k in range(20):
        open_view.expose(k * 4000, Pose(0.1, 0.2, 0.3))
        hidden.expose(k * 4000, Pose(0.1, 0.2, 0.3), hidden=k < 10)
    seen, unseen = open_view.ready(10**6), hidden.ready(10**6)
    assert [valid for _, _, valid in unseen[:10]] == [False] * 10
    assert unseen[10:] == seen[10:]
