"""The sampler as a state machine: rotate, drive, rotate, launch, basis input, brake, again."""

from __future__ import annotations

import math

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import UsageError
from koopman_lab.geometry.planar import REST, Pose, Velocity, wrap_angle
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.desk.floor import excess_m
from offboard.desk.interlock import TO_BE_MENDED, Cause, Interlock
from offboard.sampler.plan import Draw, Launch, Planner, contains
from offboard.sampler.profile import clip, slew, stopping_speed
from offboard.sampler.redraws import Redraw, Redraws, redraw_of
from offboard.sampler.sampler_step import NOTHING, Action, Observation, Phase, Progress

MOST_DRAWS = 10_000
REACTION_S = 0.1
"""Braking distance allows for two control intervals of delay."""
STANDING_S = 0.25
"""Longer than the delay of the reported set-point, so that it may be believed."""
HEADING_GAIN_PER_S = 2.0
STEERING_DISTANCE_M = 0.1
"""Nearer than this the bearing to the target is noise, and the robot drives straight on."""
STRAY_M = 0.05
"""A run ends where it leaves Z, then the robot brakes; from there it may come back."""
ON_THE_WAY = (Phase.ROTATE_TO_TARGET, Phase.DRIVE, Phase.ROTATE_TO_HEADING, Phase.SETTLE)
UNSEEN = Interlock("tracking lost", cause=Cause.TRACKING)


class Sampler:
    """One calibration session (paper, section 5.1).

    Parameters
    ----------
    config
        The whole lab; ``config.sampler`` names what is sampled.
    planner
        Draws states and judges them.
    before
        What an interrupted session has brought that this one goes on with.
    """

    def __init__(self, config: LabConfig, planner: Planner, before: Progress = NOTHING) -> None:
        settings = config.sampler
        self.phase = Phase.WAIT
        self.runs = before.runs
        self.done = before.done
        self.frames = before.frames
        self.redraws = Redraws(config.sampler.largest_redraws_in_a_row, before.redraws)
        self.waits_for: Interlock | None = None
        """What a robot that stands waits for."""
        self.reason = ""
        """Why the session ends before all segments are recorded; empty if it does not."""
        self.total = settings.segments_per_basis * len(settings.basis_inputs)
        self._settings = settings
        self._planner = planner
        self._inputs = {index: (u[0], u[1]) for index, u in settings.indexed_inputs.items()}
        self._body = robot_type(config.robot.kind).on_two_wheels("the sampler")
        self._dt_s = config.controller.dt_s
        self._watchdog_us = round(config.motor_loop.watchdog_s * US_PER_S)
        self._stepped_us: int | None = None
        self._velocity = REST
        self._draw = Draw(Pose(0.0, 0.0, 0.0), REST)
        self._launch = Launch(0, (0.0, 0.0))
        self._steps = 0
        self._since_us = 0
        self._waits_since_us: int | None = None
        self._excess_m = 0.0

    @property
    def driving(self) -> bool:
        """Return whether the robot moves, or is about to."""
        return self._velocity != REST or self.phase not in (Phase.WAIT, Phase.BRAKE, Phase.DONE)

    @property
    def basis_index(self) -> int:
        """Index of the basis input that is next or now applied; they take turns."""
        return list(self._inputs)[self.done % len(self._inputs)]

    def see_frames(self, number: int) -> None:
        """Count tracked camera frames if a basis input is being applied."""
        if self.phase is Phase.BASIS:
            self.frames += number

    def step(self, seen: Observation, now_us: int) -> Action:
        """Return what to command for the next control interval.

        Raises
        ------
        UsageError
            If the sets leave no room for a run.
        """
        if self.phase not in (Phase.WAIT, Phase.BRAKE, Phase.DONE):
            self._give_up_if_hindered(seen, now_us)
        self._stepped_us = now_us
        # A phase that finds itself at its end hands over within the same step.
        for _ in Phase:
            u = self._input_of_phase(seen, now_us)
            if u is not None:
                break
        else:
            u = self._towards(REST)
        self._velocity = self._planner.velocity_after(self._velocity, u)
        self._steps += 1
        return Action(self.phase, self.runs, self.basis_index, u)

    def _input_of_phase(self, seen: Observation, now_us: int) -> tuple[float, float] | None:
        """Return the input of the present phase, or None after moving on to another phase."""
        if self.phase is Phase.DONE:
            return self._towards(REST)
        if self.phase is Phase.WAIT:
            if self._is_ready(seen, now_us) or self.reason:
                self._enter(Phase.BRAKE, now_us)
                return None
            return self._towards(REST)
        if self.phase is Phase.BRAKE:
            return self._brake(seen, now_us)
        assert seen.pose is not None  # by _give_up_if_hindered
        if self.phase is Phase.DRIVE:
            return self._drive(seen.pose, now_us)
        if self.phase is Phase.SETTLE:
            return self._settle(seen.pose, now_us)
        if self.phase is Phase.LAUNCH:
            return self._launch_step(now_us)
        if self.phase is Phase.BASIS:
            return self._basis(seen.pose, now_us)
        return self._rotate(seen.pose, now_us)

    def _give_up_if_hindered(self, seen: Observation, now_us: int) -> None:
        """Give the run up where it cannot go on."""
        limit_us = round(self._settings.phase_time_limit_s * US_PER_S)
        interlock = self._interlock(seen)
        if interlock is not None:
            if interlock.cause in TO_BE_MENDED:
                self.reason = interlock.reason
            if interlock.ends_session:
                # The robot does not do what was sent last: to ramp down from it would move it.
                self._velocity = REST
            self._give_up(redraw_of(interlock), now_us)
        elif self.phase is not Phase.BASIS and now_us - self._since_us > limit_us:
            self._give_up(Redraw.TOOK_TOO_LONG, now_us)
        elif self.phase in (Phase.LAUNCH, Phase.BASIS) and self._is_late(now_us):
            self._give_up(Redraw.COMMANDS_LATE, now_us)
        elif seen.pose is not None and self.phase in ON_THE_WAY and self._strays(seen.pose):
            self._give_up(Redraw.LEFT_Z_ON_THE_WAY, now_us)
        elif (
            seen.pose is not None
            and self.phase is Phase.LAUNCH
            and not self._inside(seen.pose, self._velocity)
        ):
            self._give_up(Redraw.LEFT_Z_IN_LAUNCH, now_us)

    def _interlock(self, seen: Observation) -> Interlock | None:
        return seen.interlock or (UNSEEN if seen.pose is None else None)

    def _is_ready(self, seen: Observation, now_us: int) -> bool:
        """Return whether a robot that stands may be driven; it waits for so long only."""
        self.waits_for = interlock = self._interlock(seen)
        if interlock is None:
            self._waits_since_us = None
            return True
        if interlock.ends_session:
            self.reason = interlock.reason
            return False
        if self._waits_since_us is None:
            self._waits_since_us = now_us
        limit_s = self._settings.wait_limit_s
        if now_us - self._waits_since_us >= round(limit_s * US_PER_S):
            self.reason = f"waited {limit_s:g} s in vain (sampler.wait_limit_s): {interlock.reason}"
        return False

    def _strays(self, pose: Pose) -> bool:
        """Return whether the robot leaves the positions of Z, or goes farther away from them."""
        excess = excess_m(self._settings.admissible_set, pose.x1, pose.x2)
        self._excess_m = min(self._excess_m, excess)
        return excess > self._excess_m + STRAY_M

    def _is_late(self, now_us: int) -> bool:
        """Return whether the motor loop has heard nothing for so long that it began to brake.

        It may say so only after this step, or never, since this step's command ends it.
        """
        return self._stepped_us is not None and now_us - self._stepped_us >= self._watchdog_us

    def _inside(self, pose: Pose, velocity: Velocity) -> bool:
        return contains(self._settings.admissible_set, pose, velocity)

    def _rotate(self, pose: Pose, now_us: int) -> tuple[float, float] | None:
        target = self._draw.pose
        to_target = self.phase is Phase.ROTATE_TO_TARGET
        if to_target and self._distance(pose) < self._settings.position_tolerance_m:
            self._enter(Phase.ROTATE_TO_HEADING, now_us)
            return None
        heading = self._bearing(pose) if to_target else target.theta
        error = wrap_angle(heading - pose.theta)
        slow = abs(self._velocity.omega) < 3.0 * self._settings.angle_tolerance_rad
        if slow and abs(error) < self._settings.angle_tolerance_rad / 3.0:
            self._enter(Phase.DRIVE if to_target else Phase.SETTLE, now_us)
            return None
        speed = stopping_speed(error, self._settings.turn_acceleration_rad_per_s2, REACTION_S)
        return self._towards(Velocity(0.0, clip(speed, self._settings.turn_speed_rad_per_s)))

    def _drive(self, pose: Pose, now_us: int) -> tuple[float, float] | None:
        distance = self._distance(pose)
        error = wrap_angle(self._bearing(pose) - pose.theta)
        along = distance * math.cos(error)
        if along < self._settings.position_tolerance_m / 4.0:
            self._enter(Phase.ROTATE_TO_HEADING, now_us)
            return None
        speed = stopping_speed(along, self._settings.acceleration_m_per_s2, REACTION_S)
        omega = HEADING_GAIN_PER_S * error if distance > STEERING_DISTANCE_M else 0.0
        return self._towards(
            Velocity(
                min(speed, self._settings.drive_speed_m_per_s),
                clip(omega, self._settings.turn_speed_rad_per_s),
            )
        )

    def _settle(self, pose: Pose, now_us: int) -> tuple[float, float] | None:
        if self._velocity != REST:
            self._since_us = now_us
        elif now_us - self._since_us >= round(self._settings.settle_s * US_PER_S):
            turned = abs(wrap_angle(pose.theta - self._draw.pose.theta))
            if (
                self._distance(pose) > self._settings.position_tolerance_m
                or turned > self._settings.angle_tolerance_rad
            ):
                self._give_up(Redraw.MISSED_POSE, now_us)
                return None
            u = self._inputs[self.basis_index]
            if not self._planner.worth_driving(pose, self._launch, u):
                self._give_up(Redraw.RUN_WOULD_LEAVE_Z, now_us)
                return None
            self._enter(Phase.LAUNCH, now_us)
            return None
        return self._towards(REST)

    def _launch_step(self, now_us: int) -> tuple[float, float] | None:
        if self._steps >= self._launch.steps:
            self._enter(Phase.BASIS, now_us)
            return None
        return self._launch.u

    def _basis(self, pose: Pose, now_us: int) -> tuple[float, float] | None:
        u = self._inputs[self.basis_index]
        stays = self._inside(pose, self._planner.velocity_after(self._velocity, u))
        if stays and self._steps < self._settings.largest_steps:
            return u
        if self._steps >= self._settings.smallest_steps:
            self.done += 1
            self.redraws.succeed()
        else:
            self._count(Redraw.LEFT_Z_TOO_SOON)
        self.runs += 1
        self._enter(Phase.BRAKE, now_us)
        return None

    def _brake(self, seen: Observation, now_us: int) -> tuple[float, float] | None:
        if self._velocity != REST:
            self._since_us = now_us
            return self._towards(REST)
        if now_us - self._since_us < round(STANDING_S * US_PER_S):
            return self._towards(REST)
        is_lost = seen.interlock is not None and seen.interlock.ends_session
        setpoint = seen.setpoint if self._body.integrates and not is_lost else None
        if setpoint is not None and max(map(abs, setpoint)) > 1e-6:
            # Commands were lost on the way: the robot still moves by what they would have taken.
            # What it says of that now is old until the correction has arrived and was told of.
            self._velocity, self._since_us = setpoint, now_us
            return self._towards(REST)
        if self.done == self.total or self.reason:
            self._enter(Phase.DONE, now_us)
            return None
        if not self._is_ready(seen, now_us):
            return self._towards(REST)
        assert seen.pose is not None  # by _is_ready
        self._draw_next()
        self._excess_m = excess_m(self._settings.admissible_set, seen.pose.x1, seen.pose.x2)
        self._enter(Phase.ROTATE_TO_TARGET, now_us)
        return None

    def _draw_next(self) -> None:
        u = self._inputs[self.basis_index]
        for _ in range(MOST_DRAWS):
            self._draw = self._planner.draw()
            self._launch = self._planner.launch(self._draw.velocity)
            if self._planner.worth_driving(self._draw.pose, self._launch, u):
                return
            self.redraws.add_draw()
        raise UsageError(
            f"sampler: none of {MOST_DRAWS} states drawn from sampler.draw_set stays in "
            f"sampler.admissible_set for {self._settings.smallest_steps} steps of basis input {u}; "
            "enlarge the set or lower sampler.smallest_steps"
        )

    def _give_up(self, reason: Redraw, now_us: int) -> None:
        if self.phase is Phase.BASIS:
            self.runs += 1
        self._count(reason)
        self._enter(Phase.BRAKE, now_us)

    def _count(self, reason: Redraw) -> None:
        self.redraws.add(reason)
        self.reason = self.reason or self.redraws.too_many

    def _enter(self, phase: Phase, now_us: int) -> None:
        self.phase = phase
        self._since_us = now_us
        self._steps = 0

    def _towards(self, target: Velocity) -> tuple[float, float]:
        """Return the input of a step from the present velocity towards another."""
        s, now = self._settings, self._velocity
        v = slew(now.v, target.v, s.acceleration_m_per_s2 * self._dt_s)
        omega = slew(now.omega, target.omega, s.turn_acceleration_rad_per_s2 * self._dt_s)
        return self._body.input_towards(now, (v, omega), self._dt_s)

    def _distance(self, pose: Pose) -> float:
        return math.hypot(self._draw.pose.x1 - pose.x1, self._draw.pose.x2 - pose.x2)

    def _bearing(self, pose: Pose) -> float:
        return math.atan2(self._draw.pose.x2 - pose.x2, self._draw.pose.x1 - pose.x1)
