"""No robot that does what it is told is accused of anything, whatever its motors and commands.

That is what the patience of ``wheel_plausibility`` is measured against: the doubt that the motor
loop has of wheels that obey stays below half of what a fault takes.
"""

import random

import pytest
from first_order_drives import (
    FRICTION_DUTIES,
    FULL_DUTY_RAD_PER_S,
    LAGS_S,
    FirstOrderDrives,
    with_real_gains,
)
from motor_bench import TICK_US, Bench

from koopman_lab.config.load import load_config
from onboard.motor_loop.command_arbiter import Intent

SHARES = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.03, 0.02), (0.5, 0.5))
"""Of the largest inputs; the others are drawn."""
WITHOUT_DOUBT = 0.5


def largest_doubt(bench, seed, seconds):
    """Command steps, creeping, reversals and rest at random; return the largest doubt."""
    rng, largest, left = random.Random(seed), 0.0, 0
    largest_u = bench.loop.arbiter._largest_u
    for k in range(round(seconds * 100)):
        if k % 5 == 0:
            if left == 0:
                left = rng.choice([1, 2, 4, 8, 20, 40])
                share = rng.choice([*SHARES, (rng.uniform(-1, 1), rng.uniform(-1, 1))])
            left -= 1
            u = [part * most for part, most in zip(share, largest_u, strict=True)]
            refusal = bench.command(u, intent=Intent.CONTINUE if k else Intent.BEGIN)
            assert refusal is None, bench.loop.fault
        bench.tick()
        largest = max(largest, bench.loop._health.wheels.doubt)
    assert not bench.loop.fault
    return largest


@pytest.mark.parametrize("late_ticks", [0, 2])
@pytest.mark.parametrize("counts_per_rev", [800, 2400, 10_000])
@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_motors_that_nobody_has_measured(kind, counts_per_rev, late_ticks):
    """All for which the gains are made; up to 20 ms pass until a duty is at the motor."""
    config = with_real_gains(kind, counts_per_rev)
    for full in FULL_DUTY_RAD_PER_S:
        for lag_s in LAGS_S:
            for friction_duty in FRICTION_DUTIES:
                motor = full, lag_s, friction_duty
                bench = Bench(config)
                # A wheel that stands still at a duty of more than 0.2 is stuck, be it for a moment.
                bench.loop._health._stuck_duty = 1.0
                bench.plant.drives = FirstOrderDrives(*motor, late_ticks)
                assert largest_doubt(bench, 1, 8.0) < WITHOUT_DOUBT, motor


UNLIKE = ((1.4, 0.0), (1.0 / 1.4, 0.0), (1.25, 0.05), (0.8, 0.05), (1.0, 0.08))
"""How many times as strong the left motor is, and how much more friction the right wheel has."""


@pytest.mark.parametrize(("stronger", "more_friction_duty"), UNLIKE)
@pytest.mark.parametrize("gains", ["lab", "real"])
@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_motors_that_are_not_alike(kind, gains, stronger, more_friction_duty):
    """The weaker one gets more duty and yet is the slower one, until its integral has learned."""
    config = with_real_gains(kind) if gains == "real" else load_config(robot=kind)
    # The gains of preset lab are made for its own motors only.
    fulls, lags_s = (FULL_DUTY_RAD_PER_S, LAGS_S) if gains == "real" else ((30.0,), (0.05,))
    for full in fulls:
        for lag_s in lags_s:
            bench = Bench(config)
            bench.loop._health._stuck_duty = 1.0
            bench.plant.drives = FirstOrderDrives(
                full, lag_s, 0.02, stronger=stronger, more_friction_duty=more_friction_duty
            )
            assert largest_doubt(bench, 1, 20.0) < WITHOUT_DOUBT, (full, lag_s)


class StallingBench(Bench):
    """On a machine that is too busy: now and then the loop or the motors' driver stands still.

    The driver neither takes duties nor tells of the encoders then; what waits, it takes at once.
    """

    def __init__(self, config, seed, longest_ticks):
        super().__init__(config)
        self._rng, self._longest = random.Random(-seed), longest_ticks
        self._stalled = {"loop": 0, "driver": 0}
        self._duties = (0.0, 0.0)

    def tick(self):
        for part, left in self._stalled.items():
            begins = left == 0 and self._rng.random() < 0.03
            self._stalled[part] = (
                self._rng.randint(1, self._longest) if begins else max(0, left - 1)
            )
        self.plant.advance(self.now_us)
        if not self._stalled["driver"]:
            self.plant.drive(*self._duties)
            self.loop.encoder(self.now_us, *self.plant.encoder_counts(), self.battery_v)
        if not self._stalled["loop"]:
            self._duties = self.loop.tick(self.now_us)
            if not self._stalled["driver"]:
                self.plant.drive(*self._duties)
        self.now_us += TICK_US


@pytest.mark.parametrize("longest_ticks", [2, 5, 10])
@pytest.mark.parametrize("preset", ["lab", "harsh"])
@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_the_simulated_robots_on_a_machine_that_is_too_busy(kind, preset, longest_ticks):
    """A third of the time something stands still, for up to a tenth of a second."""
    for seed in range(3):
        bench = StallingBench(load_config(robot=kind, preset=preset), seed, longest_ticks)
        assert largest_doubt(bench, seed, 60.0) < WITHOUT_DOUBT


@pytest.mark.parametrize("preset", ["lab", "harsh"])
@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
@pytest.mark.parametrize("seed", range(3))
def test_the_simulated_robots(kind, preset, seed):
    bench = Bench(load_config(robot=kind, preset=preset))
    assert largest_doubt(bench, seed, 60.0) < WITHOUT_DOUBT
