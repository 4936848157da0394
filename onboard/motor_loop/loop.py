"""The onboard program: who may command, what the set-point is, what the motors get."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, NamedTuple

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry import REST, Velocity, wheel_speeds
from koopman_lab.units import US_PER_S
from onboard.motor_loop.odometry import Odometry
from onboard.motor_loop.pid import WheelController
from onboard.motor_loop.setpoint import AccelerationRamp, approach, saturate

NOBODY = 0
Refusal = Literal["value", "stale", "order", "commander", "type"]


class State(IntEnum):
    """Of the loop; the numbers are those of ``onboard_status_t``."""

    REST = 0
    DRIVING = 1
    WATCHDOG = 2
    ESTOP = 3


class Command(NamedTuple):
    """A velocity (m/s, rad/s) or an acceleration (m/s^2, rad/s^2), as the robot's kind has it."""

    utime: int
    sequence: int
    commander: int
    u1: float
    u2: float


@dataclass
class Counts:
    """Commands accepted and refused since start."""

    accepted: int = 0
    refused: dict[Refusal, int] = field(
        default_factory=lambda: {"value": 0, "stale": 0, "order": 0, "commander": 0, "type": 0}
    )


class MotorLoop:
    """100 Hz loop of both wheels, with the rules of who may move the robot.

    The first commander to be accepted holds the robot until its commands stop for
    ``watchdog_s``; then the loop ramps to rest within the acceleration limits and takes no
    command before it stands. The e-stop sets the motors to zero in the next tick and holds until
    it is released. All times are int64 microseconds of the onboard clock, which never steps.
    """

    def __init__(self, config: LabConfig) -> None:
        loop = config.motor_loop
        self.state = State.REST
        self.setpoint = REST
        self.holder = NOBODY
        self.counts = Counts()
        self.battery_v = 0.0
        self.odometry = Odometry(loop.encoder_counts_per_rev, loop.wheel_state_window_s)
        self._robot = config.robot
        self._limits = loop.limits
        self._tick_s = 1.0 / loop.rate_hz
        self._watchdog_us = round(loop.watchdog_s * US_PER_S)
        self._lifetime_us = round(loop.command_lifetime_s * US_PER_S)
        self._accelerates = config.robot.kind == "dynamic"
        limits = loop.limits
        self._largest_u = (
            (limits.a_m_per_s2, limits.d_omega_rad_per_s2)
            if self._accelerates
            else (limits.v_m_per_s, limits.omega_rad_per_s)
        )
        self._ramp = AccelerationRamp(limits, config.controller.dt_s, self._tick_s)
        self._target = REST
        self._last_sequence = -1
        self._accepted_at_us = 0
        self._wheels = (WheelController(loop.pid), WheelController(loop.pid))

    def command(self, command: Command, now_us: int) -> Refusal | None:
        """Take a command; return why it was refused, or None."""
        refusal = self._refusal(command, now_us)
        if refusal is not None:
            self.counts.refused[refusal] += 1
            return refusal
        self.counts.accepted += 1
        if self.state is State.REST:
            self.state = State.DRIVING
            self.holder = command.commander
            self._ramp.reset(self.setpoint)
        self._last_sequence = command.sequence
        self._accepted_at_us = now_us
        if self._accelerates:
            self._ramp.command(command.u1, command.u2)
        else:
            self._target = saturate(Velocity(command.u1, command.u2), self._limits)
        return None

    def refuse_type(self) -> None:
        """Count a command that was of the other robot's type, or not decodable."""
        self.counts.refused["type"] += 1

    def estop(self, engaged: bool) -> None:
        """Engage or release the emergency stop."""
        if engaged:
            self._stand(State.ESTOP)
        elif self.state is State.ESTOP:
            self._stand(State.REST)

    def encoder(self, utime: int, left_count: int, right_count: int, battery_v: float) -> None:
        """Take the newest encoder counters."""
        self.odometry.update(utime, left_count, right_count)
        self.battery_v = battery_v

    def tick(self, now_us: int) -> tuple[float, float]:
        """Return the duties ``(left, right)`` for the next tick."""
        if self.state is State.ESTOP:
            return 0.0, 0.0
        self._watch(now_us)
        if self.state is State.DRIVING:
            if self._accelerates:
                self.setpoint = self._ramp.step(self.setpoint)
            else:
                self.setpoint = approach(self.setpoint, self._target, self._limits, self._tick_s)
        elif self.state is State.WATCHDOG:
            self.setpoint = approach(self.setpoint, REST, self._limits, self._tick_s)
        return self._control()

    def _control(self) -> tuple[float, float]:
        robot = self._robot
        wanted = wheel_speeds(*self.setpoint, robot.wheel_radius_m, robot.track_width_m)
        newest = self.odometry.newest()
        measured = (newest.left, newest.right) if newest else (0.0, 0.0)
        if self.setpoint == REST and measured == (0.0, 0.0):
            # Standing as wanted: without this the integral would keep pushing against friction.
            for wheel in self._wheels:
                wheel.reset()
            return 0.0, 0.0
        left, right = (
            wheel.step(setpoint, speed, self._tick_s)
            for wheel, setpoint, speed in zip(self._wheels, wanted, measured, strict=True)
        )
        return left, right

    def _refusal(self, command: Command, now_us: int) -> Refusal | None:
        for u, largest in zip((command.u1, command.u2), self._largest_u, strict=True):
            if not math.isfinite(u) or abs(u) > largest * (1.0 + 1e-9):
                return "value"
        if abs(now_us - command.utime) > self._lifetime_us:
            return "stale"
        if self.state in (State.ESTOP, State.WATCHDOG):
            return "order"
        if self.state is State.DRIVING:
            if command.commander != self.holder:
                return "commander"
            if command.sequence <= self._last_sequence:
                return "order"
        return None

    def _watch(self, now_us: int) -> None:
        if self.state is State.DRIVING and now_us - self._accepted_at_us > self._watchdog_us:
            self.state = State.WATCHDOG
        elif self.state is State.WATCHDOG and self.setpoint == REST:
            self._stand(State.REST)

    def _stand(self, state: State) -> None:
        self.state = state
        self.setpoint = self._target = REST
        self.holder = NOBODY
        self._ramp.reset(REST)
        for wheel in self._wheels:
            wheel.reset()
