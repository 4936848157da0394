"""The predictive controller as a state machine: wait, drive, pause, stop in one of three ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.age import is_current
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose, relative_to
from koopman_lab.mpc.receding_horizon import Decision, RecedingHorizon
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.controller.controller_step import Inputs, Outputs, State
from offboard.controller.estimate import StateEstimator
from offboard.desk.floor import require_on_floor
from offboard.desk.interlock import Interlock
from offboard.desk.parked import is_at_rest, is_inside
from offboard.desk.results import Pause

STOP_LIMIT_S = 2.0
"""The end is reported after this time even if no wheel odometry shows the robot at rest."""


class Controller:
    """Drives the robot to a goal pose.

    The optimiser works in the frame of the goal: the robot's motion does not depend on where the
    frame lies, and the problem has no terminal ingredients (paper, section 2.1).

    Parameters
    ----------
    config
        The lab.
    optimiser
        Made for the same configuration, and used by nobody else.
    goal
        Goal pose in the inertial frame.

    Raises
    ------
    UsageError
        If the robot must not be sent there.
    """

    def __init__(self, config: LabConfig, optimiser: RecedingHorizon, goal: Pose) -> None:
        self.state = State.WAIT
        require_on_floor(goal, config.floor)
        self.goal = goal
        self.reason = ""
        """Why the drive ended, or what it waits for."""
        self.pauses: list[Pause] = []
        """Those that have ended."""
        self._settings, self._floor = config.controller, config.floor
        robot = robot_type(config.robot.kind)
        self._robot = robot
        self._no_input = np.zeros(robot.input_dim)
        self._state_dim = robot.state_dim
        self.optimiser = optimiser
        """What finds the inputs."""
        self._estimator = StateEstimator(config, goal, optimiser.advance)
        self._started_us = 0
        self._goal_us = 0
        self._ended_us = 0
        self._paused_us = 0
        self._inside_since_us: int | None = None

    def step(self, seen: Inputs, now_us: int) -> Outputs:
        """Return what to command for the next sampling interval, and what to report."""
        self._estimator.update(seen.frames, seen.wheels, now_us)
        acts_us = now_us + round(seen.delay_s * US_PER_S)
        x = self._estimator.state(acts_us)
        interlock = self._interlock(seen, now_us)
        if interlock is not None and interlock.ends_session:
            self._give_up(interlock.reason, now_us)
        if self.state is State.WAIT:
            self._start_if_ready(interlock, now_us)
        if self.state is State.PAUSED:
            self._resume_or_end(interlock, now_us)
        if self.state is State.DRIVING and x is not None:
            self._end_if_due(interlock, x, now_us)
            if self.state is State.DRIVING:
                decision = self.optimiser.step(x)
                if decision.failures_in_a_row < self._settings.largest_failures_in_a_row:
                    self._estimator.apply(decision.u, acts_us)
                    return self._driving(x, decision)
                failures = f"solver failed {decision.failures_in_a_row} times in a row"
                self._end(State.FAILED, failures, now_us)
        self._estimator.apply(self._no_input, acts_us)
        return self._standing(x, now_us)

    def move_goal(self, goal: Pose, now_us: int) -> None:
        """Drive to another goal, with the whole time limit before it.

        Raises
        ------
        UsageError
            If the robot must not be sent there; the old goal stays.
        """
        require_on_floor(goal, self._floor)
        if goal == self.goal:
            return
        self.goal = goal
        self._goal_us = now_us
        self._inside_since_us = None
        self._estimator.move_goal(goal)
        self.optimiser.restart()

    def pose(self) -> Pose | None:
        """Return the newest usable measured pose relative to the goal."""
        frame = self._estimator.frame
        return None if frame is None else relative_to(self.goal, frame.pose)

    def duration_s(self, now_us: int) -> float:
        """Return how long the drive took, or has taken until now."""
        if self.state is State.WAIT:
            return 0.0
        end_us = now_us if self.state in (State.DRIVING, State.PAUSED) else self._ended_us
        return (end_us - self._started_us) / US_PER_S

    def _start_if_ready(self, interlock: Interlock | None, now_us: int) -> None:
        self.reason = "" if interlock is None else f"waits: {interlock.reason}"
        if interlock is None:
            self.state = State.DRIVING
            self._started_us = self._goal_us = now_us

    def _give_up(self, reason: str, now_us: int) -> None:
        """End a drive that is under way, or not begun."""
        if self.state is State.WAIT:
            self._started_us = now_us
        if self.state in (State.WAIT, State.DRIVING, State.PAUSED):
            self._end(State.FAILED, reason, now_us)

    def _end_if_due(self, interlock: Interlock | None, x: NDArray[np.float64], now_us: int) -> None:
        if interlock is not None and interlock.lasting:
            self._end(State.FAILED, interlock.reason, now_us)
        elif interlock is not None:
            self.state, self.reason = State.PAUSED, interlock.reason
            self._paused_us = now_us
            self._inside_since_us = None
        elif self._held_inside(x, now_us):
            self._end(State.PARKED, "parked", now_us)
        else:
            self._end_if_late(now_us)

    def _resume_or_end(self, interlock: Interlock | None, now_us: int) -> None:
        paused_us = now_us - self._paused_us
        if interlock is None:
            self.pauses.append(Pause(reason=self.reason, duration_s=paused_us / US_PER_S))
            self.state, self.reason = State.DRIVING, ""
            self.optimiser.restart()
        elif interlock.lasting or paused_us >= round(self._settings.pause_limit_s * US_PER_S):
            self._end(State.FAILED, interlock.reason, now_us)
        else:
            self.reason = interlock.reason
            self._end_if_late(now_us)

    def _end_if_late(self, now_us: int) -> None:
        if now_us - self._goal_us >= round(self._settings.time_limit_s * US_PER_S):
            self._end(State.TIME_LIMIT, f"not parked after {self._settings.time_limit_s} s", now_us)

    def _interlock(self, seen: Inputs, now_us: int) -> Interlock | None:
        """Return what forbids driving."""
        if seen.interlock is not None:
            return seen.interlock
        frame = self._estimator.frame
        timeout_us = self._settings.tracking_timeout_s * US_PER_S
        if frame is None or not is_current(frame.utime, now_us, timeout_us):
            return Interlock("tracking lost")
        if not self._estimator.is_complete(now_us):
            return Interlock("wheel odometry lost")
        return None

    def _held_inside(self, x: NDArray[np.float64], now_us: int) -> bool:
        if self._estimator.is_measured:
            if not is_inside(x, self._settings, self._robot):
                self._inside_since_us = None
            elif self._inside_since_us is None:
                self._inside_since_us = now_us
        hold_us = round(self._settings.parked_hold_s * US_PER_S)
        return self._inside_since_us is not None and now_us - self._inside_since_us >= hold_us

    def _end(self, state: State, reason: str, now_us: int) -> None:
        self.state = state
        self.reason = reason
        self._ended_us = now_us

    def _driving(self, x: NDArray[np.float64], decision: Decision) -> Outputs:
        plan = decision.plan
        c, s = math.cos(self.goal.theta), math.sin(self.goal.theta)
        turn = np.array([[c, -s], [s, c]])
        return replace(
            self._report(x, decision.u),
            value=plan.value,
            stage_cost=self.optimiser.stage_cost(x, decision.u),
            iterations=decision.iterations,
            solved=decision.solved,
            predicted=plan.states[:, :2] @ turn.T + np.array(self.goal[:2]),
        )

    def _standing(self, x: NDArray[np.float64] | None, now_us: int) -> Outputs:
        outputs = self._report(x, self._no_input)
        if self.state in (State.WAIT, State.PAUSED):
            return outputs
        wheels = self._estimator.wheels
        after_end = wheels is not None and wheels.utime > self._ended_us
        stopped = wheels is not None and after_end and is_at_rest(*wheels.velocity)
        # Without odometry there is nothing to wait for.
        blind = not self._estimator.knows_speed(now_us)
        late = now_us - self._ended_us >= round(STOP_LIMIT_S * US_PER_S)
        return replace(outputs, finished=stopped or blind or late)

    def _report(self, x: NDArray[np.float64] | None, u: NDArray[np.float64]) -> Outputs:
        state_in_goal_frame = np.zeros(self._state_dim) if x is None else x
        frame = self._estimator.frame
        pose_utime = None if frame is None else frame.utime
        holds = self.state in (State.WAIT, State.DRIVING)
        return Outputs(self.state, holds, tuple(u.tolist()), state_in_goal_frame, pose_utime)
