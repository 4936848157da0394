"""The motor loop on the plant, tick by tick, for the tests of either; a disk for its stops."""

import numpy as np

from koopman_lab.errors import LabStateError
from onboard.motor_loop.command_arbiter import Command, Intent
from onboard.motor_loop.loop import MotorLoop
from onboard.plant.plant import Plant

TICK_US = 10_000
SAMPLER, CONTROLLER = 1, 2


class Bench:
    """The loop on the plant, tick by tick, without a bus."""

    def __init__(self, config):
        self.plant = Plant(config, np.random.default_rng(0))
        self.loop = MotorLoop(config)
        self.now_us = 0
        self.sequence = 0
        self.battery_v = 7.4
        self.silent = False

    def tick(self):
        self.plant.advance(self.now_us)
        if not self.silent:
            self.loop.encoder(self.now_us, *self.plant.encoder_counts(), self.battery_v)
        self.plant.drive(*self.loop.tick(self.now_us))
        self.now_us += TICK_US

    def sleep(self, seconds, *, stands):
        """Keep the loop from running; the motors' drivers let go at once, or not at all."""
        if stands:
            self.plant.drive(0.0, 0.0)
        for _ in range(round(seconds * 100)):
            self.plant.advance(self.now_us)
            self.loop.encoder(self.now_us, *self.plant.encoder_counts(), self.battery_v)
            self.now_us += TICK_US

    def command(self, u, commander=SAMPLER, **changes):
        fields = {"utime": self.now_us, "sequence": self.sequence, "commander": commander}
        fields |= {"intent": Intent.BEGIN, "u1": u[0], "u2": u[1]} | changes
        self.sequence += 1
        return self.loop.command(Command(**fields), self.now_us)

    def release(self):
        self.loop.release(self.loop.stop_latch.number, self.now_us)

    def drive(self, u, seconds):
        """Command every 50 ms; return set-points and true velocities of each tick."""
        rows = []
        for k in range(round(seconds * 100)):
            if k % 5 == 0:
                assert self.command(u) is None
            self.tick()
            rows.append((*self.loop.setpoint, *self.plant.body_velocity()))
        return np.array(rows)


class MemoryStore:
    """A disk that outlasts the program, and that can be made to fail."""

    def __init__(self, record=None):
        self.record = record
        self.readable = self.writable = True
        self.writes = 0

    def read(self):
        if not self.readable:
            raise LabStateError("cannot be read")
        return self.record

    def write(self, record):
        if not self.writable:
            raise LabStateError("cannot be written")
        self.record = record
        self.writes += 1
