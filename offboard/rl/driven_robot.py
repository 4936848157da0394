"""A simulated robot behind its real motor loop, without bus, radio and cameras."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from koopman_lab.bus.commanders import NOBODY, commander_number
from koopman_lab.bus.port import Timer
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose
from onboard.motor_loop.command_arbiter import Command, Intent
from onboard.motor_loop.loop import STOPPED, MotorLoop
from onboard.plant.faulty_plant import FaultyPlant
from onboard.plant.plant import Plant

COMMANDER = "controller"
"""In whose name the motor loop is commanded."""


class DrivenRobot:
    """Plant and motor loop of a lab, on a time of their own that begins at 0.

    They act in the order and at the times of a lab in lockstep whose board hears every command at
    once: the encoders are read, the motor loop ticks and the motors get its duties; a command sent
    at that time counts in the next tick. What goes wrong by itself in the configuration does so
    here.

    Parameters
    ----------
    config
        The lab; something must be simulated.
    rng
        Source of the error by which a hand places the robot.
    start
        Where the robot is placed (m, m, rad), at rest.

    Raises
    ------
    ConfigError
        If nothing is simulated.
    LabStateError
        If the robot does not roll on two driven wheels.
    """

    def __init__(self, config: LabConfig, rng: np.random.Generator, start: Pose) -> None:
        simulated = config.require_simulation().plant
        self.now_us = 0
        """Present time (us)."""
        self.loop = MotorLoop(config)
        """What the board runs."""
        self._plant = Plant(config, rng)
        self._faulty_plant = FaultyPlant(config, self._plant, self.now_us)
        self._faulty_plant.advance(self.now_us)
        self._plant.place(start)
        # The encoders come first where both are due.
        self._timers = (
            Timer(simulated.encoder_rate_hz, self._read_encoders),
            Timer(config.motor_loop.rate_hz, self._drive_motors),
        )
        self._commander = commander_number(COMMANDER, 0)
        self._commands = 0
        self._run_until(self.now_us)

    @property
    def pose(self) -> Pose:
        """Return the true pose in the inertial frame."""
        return self._plant.pose

    @property
    def velocity(self) -> tuple[float, float]:
        """Return the true body velocity (m/s, rad/s)."""
        return self._plant.body_velocity()

    @property
    def is_stopped(self) -> bool:
        """Return whether the motor loop takes no commands any more: an emergency stop, a fault."""
        return self.loop.state in STOPPED

    def apply(self, u: Sequence[float], until_us: int) -> None:
        """Command an input (m,), in the units of the robot's inputs, and go on to a time (us)."""
        held = self.loop.arbiter.holder != NOBODY
        intent = Intent.CONTINUE if held else Intent.BEGIN
        u1, u2 = u
        command = Command(self.now_us, self._commands, self._commander, intent, u1, u2)
        self._commands += 1
        self.loop.command(command, self.now_us)
        self._run_until(until_us)

    def _run_until(self, end_us: int) -> None:
        while True:
            timer = min(self._timers, key=lambda timer: timer.deadline_us)
            if timer.deadline_us > end_us:
                break
            timer.tick(timer.deadline_us)
            timer.go_on()
        self.now_us = end_us
        self._faulty_plant.advance(end_us)

    def _read_encoders(self, now_us: int) -> None:
        utime = self._faulty_plant.advance(now_us)
        left, right = self._faulty_plant.encoder_counts()
        self.loop.encoder(utime, left, right, self._plant.battery_v())

    def _drive_motors(self, now_us: int) -> None:
        left, right = self.loop.tick(now_us)
        self._faulty_plant.drive(left, right, now_us)
