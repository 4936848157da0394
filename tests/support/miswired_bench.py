"""A robot whose motors and encoders are miswired, beside one that does what it is told."""

import math
from itertools import product
from typing import NamedTuple

from motor_bench import TICK_US, Bench

from koopman_lab.units import wrap_counter
from onboard.motor_loop.command_arbiter import Intent
from onboard.motor_loop.loop import State
from onboard.plant.wiring import AS_INTENDED, Wiring

WIRINGS = [
    Wiring(left, right, exchanged)
    for exchanged, left, right in product((False, True), (1, -1), (1, -1))
]
"""All signed permutations of two things."""
OFF_RAD_PER_S = 1.0
"""A wheel is off its way if it is so much faster or slower than it should be: 3 cm/s."""
WATCHED_TICKS = 300
DRIVEN_TICKS = 150
STANDING_TICKS = 100


def as_the_board_sees(motors, encoders):
    """Return what the encoders tell of duties (1, 2) for left and right."""
    return encoders.to_board(*motors.to_parts(1, 2))


class MiswiredBench(Bench):
    """The loop on a plant whose wires can be exchanged while it drives."""

    def __init__(self, config):
        super().__init__(config)
        self.motors = self.encoders = AS_INTENDED
        self._true = self._shown = (0, 0)

    def tick(self):
        self.plant.advance(self.now_us)
        true = self.plant.encoder_counts()
        steps = (wrap_counter(now - before) for now, before in zip(true, self._true, strict=True))
        step = self.encoders.to_board(*steps)
        self._true = true
        self._shown = (self._shown[0] + step[0], self._shown[1] + step[1])
        self.loop.encoder(self.now_us, *self._shown, self.battery_v)
        self.plant.drive(*self.motors.to_parts(*self.loop.tick(self.now_us)))
        self.now_us += TICK_US

    def turned_rad(self):
        """Return how far the wheels have truly turned, (left, right)."""
        return self.plant._left_rad, self.plant._right_rad

    def speeds(self):
        """Return the true speeds of the wheels, (left, right)."""
        return self.plant.drives.left_rad_per_s, self.plant.drives.right_rad_per_s


class Runaway(NamedTuple):
    """What a miswired robot did.

    Attributes
    ----------
    fault
        What the loop found, None if it drove on.
    moved_s
        From the first motion under the wrong wiring until the motors were off.
    off_s
        Time from when a wheel, as the board sees it, was first off its way until then.
    astray_m
        How far a wheel had rolled that should not have, or not rolled that should have, until then.
    way_m
        Way of the robot's centre until then.
    coast_m
        Way of the robot's centre from then until it stood.
    """

    fault: object
    moved_s: float
    off_s: float
    astray_m: float
    way_m: float
    coast_m: float


def driven_to(bench, share):
    """Return the input that takes both velocities to a share (forward, turning) of what is allowed.

    Commands of velocities have limits of their own, those of accelerations end when they are there.
    """
    largest = bench.loop.arbiter._largest_u
    u = [part * most for part, most in zip(share, largest, strict=True)]
    limits = bench.loop._limits
    if bench.loop._commanded._drive.integrates:
        for k, most in enumerate((limits.v_m_per_s, limits.omega_rad_per_s)):
            if abs(bench.loop.setpoint[k]) >= abs(share[k]) * most - 1e-9:
                u[k] = 0.0
    return u


def run_away(config, motors, encoders, share, *, in_a_drive):
    """Drive a robot whose wires are exchanged, from the start or in the middle of a drive."""
    robot, twin = MiswiredBench(config), MiswiredBench(config)
    radius_m = config.robot.wheel_radius_m

    def step(k):
        u = driven_to(robot, share)
        for bench in (robot, twin):
            if k % 5 == 0:
                bench.command(u, intent=Intent.CONTINUE if k else Intent.BEGIN)
            bench.tick()

    begin = DRIVEN_TICKS if in_a_drive else 0
    for k in range(begin):
        step(k)
    assert not robot.loop.fault
    robot.motors, robot.encoders = motors, encoders
    start, twin_start = robot.turned_rad(), twin.turned_rad()
    moved = off = None
    way_m = 0.0
    for k in range(begin, begin + WATCHED_TICKS):
        before, was = robot.plant.coordinates, robot.turned_rad()
        step(k)
        way_m += math.dist(before[:2], robot.plant.coordinates[:2])
        if moved is None and was != robot.turned_rad():
            moved = k
        pairs = zip(encoders.to_board(*robot.speeds()), twin.speeds(), strict=True)
        if off is None and any(abs(speed - told) > OFF_RAD_PER_S for speed, told in pairs):
            off = k
        if robot.loop.state is State.FAULT:
            turned = [now - then for now, then in zip(robot.turned_rad(), start, strict=True)]
            told = [now - then for now, then in zip(twin.turned_rad(), twin_start, strict=True)]
            pairs = zip(encoders.to_board(*turned), told, strict=True)
            astray_m = radius_m * max(abs(turn - told) for turn, told in pairs)
            since = [0.0 if first is None else 0.01 * (k - first) for first in (moved, off)]
            return Runaway(robot.loop.fault, *since, astray_m, way_m, coast(robot))
    return Runaway(None, 0.0, 0.0, 0.0, way_m, 0.0)


def coast(robot):
    """Let a robot run out whose motors are off; return its way (m)."""
    way_m = 0.0
    for _ in range(STANDING_TICKS):
        before = robot.plant.coordinates
        robot.tick()
        way_m += math.dist(before[:2], robot.plant.coordinates[:2])
    assert robot.speeds() == (0.0, 0.0)
    return way_m
