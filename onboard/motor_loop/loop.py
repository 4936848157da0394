"""The onboard program: what the set-point is, what the motors get, when the robot must stop."""

from __future__ import annotations

from enum import IntEnum

from koopman_lab.bus.age import is_current
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import REST, Velocity, body_velocity, wheel_speeds
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from onboard.motor_loop.command_arbiter import Command, CommandArbiter, Intent, Refusal
from onboard.motor_loop.health import FOLLOW_US, NO_FAULT, OLDEST_US, Health
from onboard.motor_loop.odometry import Odometry, Speeds
from onboard.motor_loop.pid import WheelController
from onboard.motor_loop.setpoint import Setpoint, approach, saturate
from onboard.motor_loop.stop_latch import StopLatch
from onboard.motor_loop.wheel_pair import LEFT, RIGHT

Duties = tuple[float, float]
NO_DUTY: Duties = (0.0, 0.0)
STANDING: Speeds = (0.0, 0.0)
LONGEST_HOLD_S = 0.3
"""So long the wheels are held after a ramp to rest, if they do not stand before: six times the lag
of the motors of preset `lab`. Then they get no duty, whatever the encoders say."""


class State(IntEnum):
    """States of the loop; the numbers are those of ``onboard_status_t``."""

    REST = 0
    DRIVING = 1
    WATCHDOG = 2
    ESTOP = 3
    FAULT = 4


STOPPED = (State.ESTOP, State.FAULT)
# By name, since an enumeration looks each of its members up anew.
AT_REST, DRIVING, WATCHDOG = State.REST, State.DRIVING, State.WATCHDOG


class MotorLoop:
    """100 Hz loop of both wheels.

    When the commander that holds the robot falls silent, the loop ramps to rest within the
    acceleration limits and stays there until a command begins a new sequence. After a ramp to rest
    the wheels are held until they stand, :data:`LONGEST_HOLD_S` at most; from then on the motors
    get no duty, whatever the encoders say. Only then does the state of a robot that was given up
    become REST, so that in REST no motor ever gets any.

    The emergency stop and any fault set the motors to zero in the next tick and hold until they are
    released; only silent encoders release themselves when they are heard again. A loop that was
    itself kept from running, longer than the watchdog waits, takes the robot as it finds it and
    brings it to rest. All times are int64 microseconds of the onboard clock, which never steps.

    Raises
    ------
    LabStateError
        If the robot does not roll on two driven wheels.
    """

    def __init__(self, config: LabConfig) -> None:
        loop = config.motor_loop
        self.state = State.REST
        self.fault = NO_FAULT
        self.setpoint = REST
        self.arbiter = CommandArbiter(config)
        self.battery_v: float | None = None
        self.odometry = Odometry(loop.encoder_counts_per_rev, loop.wheel_state_window_s)
        self._wheel_radius_m = config.robot.wheel_radius_m
        self._track_width_m = config.robot.track_width_m
        self._limits = loop.limits
        self._tick_s = 1.0 / loop.rate_hz
        drive = robot_type(config.robot.kind).on_two_wheels()
        self._commanded = Setpoint(drive, loop.limits, config.controller.dt_s, self._tick_s)
        self._releasing = False
        self.stop_latch = StopLatch()
        self._held_ticks = 0
        self._longest_hold_ticks = round(LONGEST_HOLD_S * loop.rate_hz)
        self._encoder_us: int | None = None
        self._ticked_us: int | None = None
        self._longest_pause_us = round(loop.watchdog_s * US_PER_S)
        self._duties = NO_DUTY
        self._wheel_setpoints: Speeds = STANDING
        self._health = Health(loop, self._fastest_wheel())
        self._wheels = (WheelController(loop.pid), WheelController(loop.pid))

    def command(self, command: Command, now_us: int) -> Refusal | None:
        """Take a command; return why it was refused, or None."""
        if self.state in STOPPED:
            return self.arbiter.refuse("stopped")
        is_at_rest = self.setpoint == REST
        refusal = self.arbiter.consider(command, now_us, ready=is_at_rest)
        if refusal is not None:
            return refusal
        if self.state is not DRIVING:
            self.state = DRIVING
            self._commanded.reset(REST)
        self._releasing = command.intent is Intent.RELEASE
        if not self._releasing:
            self._held_ticks = 0
            self._commanded.command((command.u1, command.u2))
        return None

    def refuse_type(self) -> None:
        """Count a command that was of another robot's type, or not decodable."""
        self.arbiter.refuse("type")

    def stop(self, now_us: int, ordered_us: int) -> None:
        """Engage the emergency stop, ordered at ``ordered_us`` by the sender's stamp."""
        self.stop_latch.engage(now_us, ordered_us)
        self._stop_at_once(State.ESTOP)

    def release(self, stop_number: int, ordered_us: int) -> None:
        """Release the stop of that number, and with it a fault; see :class:`StopLatch`."""
        if self.stop_latch.release(stop_number, ordered_us):
            self._stand_by()

    def hold(self, fault: Fault, now_us: int) -> None:
        """Hold the robot for what was found outside the loop, or before it began.

        ``fault`` is NO_FAULT for an emergency stop.
        """
        self.stop_latch.engage(now_us, now_us)
        self.fault = fault
        self._stop_at_once(State.FAULT if fault else State.ESTOP)

    def encoder(self, utime: int, left_count: int, right_count: int, battery_v: float) -> None:
        """Take the newest encoder counters and battery voltage."""
        self.odometry.update(utime, left_count, right_count)
        self._encoder_us = utime
        self.battery_v = battery_v

    def tick(self, now_us: int) -> Duties:
        """Return the duties ``(left, right)`` for the next tick."""
        if self.state in STOPPED and not self._heals(now_us):
            return NO_DUTY
        encoder_us = self._encoder_us
        measured = self.odometry.newest() or STANDING
        before_us, self._ticked_us = self._ticked_us, now_us
        if before_us is not None and not is_current(before_us, now_us, self._longest_pause_us):
            fresh = encoder_us is not None and is_current(encoder_us, now_us, OLDEST_US)
            self._resume_after_pause(measured if fresh else STANDING)
        self.fault = self._health.check(
            now_us, self.battery_v, encoder_us, self._duties, measured, self._wheel_setpoints
        )
        if self.fault:
            self.hold(self.fault, now_us)
        elif self.state is not AT_REST:
            self._duties = self._driven_duties(measured, now_us)
        return self._duties

    def _fastest_wheel(self) -> float:
        """Return the largest speed of a wheel (rad/s) that the limits of the body allow."""
        limits = self._limits
        return max(
            wheel_speeds(
                limits.v_m_per_s, limits.omega_rad_per_s, self._wheel_radius_m, self._track_width_m
            )
        )

    def _heals(self, now_us: int) -> bool:
        """Return whether a stop is over by itself: a fault of encoders that are heard again."""
        if self.state is not State.FAULT or self.fault is not Fault.ENCODERS_SILENT:
            return False
        if not self._health.hears(self._encoder_us, now_us):
            return False
        self.stop_latch.clear()
        self._stand_by()
        return True

    def _driven_duties(self, measured: Speeds, now_us: int) -> Duties:
        """Move the set-point on by a tick, and return the duties that bring the wheels to it."""
        if self.state is DRIVING and not self._releasing:
            if not self.arbiter.is_silent(now_us):
                self.setpoint = self._commanded.step(self.setpoint)
                return self._control(measured)
            self.arbiter.revoke()
            self.state = WATCHDOG
        self.setpoint = approach(self.setpoint, REST, self._limits, self._tick_s)
        if self.setpoint != REST or self._holds(measured):
            return self._control(measured)
        self._stop_at_once(AT_REST if self._releasing else WATCHDOG)
        return NO_DUTY

    def _holds(self, measured: Speeds) -> bool:
        """Return whether the wheels are held after a ramp to rest; once let go, they stay so."""
        if self._releasing and not self._held_ticks:
            # What the integrals have learned on the way would push the wheels on.
            for wheel in self._wheels:
                wheel.reset()
        if measured == STANDING:
            self._held_ticks = self._longest_hold_ticks
        self._held_ticks += 1
        return self._held_ticks <= self._longest_hold_ticks

    def _resume_after_pause(self, measured: Speeds) -> None:
        """Go on after a pause of the loop itself, in which the motors' drivers have let go.

        A clock that was set looks the same.
        """
        left, right = measured
        self._duties = NO_DUTY
        self._health.reset(FOLLOW_US)
        for wheel in self._wheels:
            wheel.reset()
        if self.setpoint != REST or self.state is DRIVING:
            velocity = Velocity(
                *body_velocity(left, right, self._wheel_radius_m, self._track_width_m)
            )
            self.setpoint = saturate(velocity, self._limits)
            self.arbiter.revoke()
            self._releasing = False
            self._held_ticks = 0
            self.state = WATCHDOG

    def _control(self, measured: Speeds) -> Duties:
        left_wheel, right_wheel = self._wheels
        if self.setpoint == REST and measured == STANDING:
            # Standing as wanted: without this the integral would keep pushing against friction.
            left_wheel.reset()
            right_wheel.reset()
            self._wheel_setpoints = STANDING
            return NO_DUTY
        v, omega = self.setpoint
        left, right = wheel_speeds(v, omega, self._wheel_radius_m, self._track_width_m)
        self._wheel_setpoints = left, right
        return (
            left_wheel.step(left, measured[LEFT], self._tick_s),
            right_wheel.step(right, measured[RIGHT], self._tick_s),
        )

    def _stand_by(self) -> None:
        self._stop_at_once(AT_REST)
        self.fault = NO_FAULT
        self._health.reset()

    def _stop_at_once(self, state: State) -> None:
        self.state = state
        self.setpoint = REST
        self.arbiter.revoke()
        self._releasing = False
        self._duties, self._wheel_setpoints = NO_DUTY, STANDING
        self._commanded.reset(REST)
        for wheel in self._wheels:
            wheel.reset()
