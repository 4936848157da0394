"""Ties the sampler to the bus."""

from __future__ import annotations

import numpy as np

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.message_values import padded
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Velocity
from offboard.desk.commander import Commands, SessionInfo
from offboard.desk.drive_inputs import DriveInputs
from offboard.desk.guard import Guard
from offboard.desk.interlock import Cause, Interlock
from offboard.desk.results import CalibrationOutcome
from offboard.sampler.plan import Planner
from offboard.sampler.sampler import Sampler
from offboard.sampler.sampler_step import NOTHING, Action, Observation, Phase, Progress

SEED_STREAM = 2
"""Among the generators that grow from ``config.seed``."""
FAREWELLS = 4
"""The last state is sent this often, so that losing one message loses nothing."""


class SamplerNode:
    """Listens to poses and to who is alive; commands the robot and says so in SAMPLER_STATE.

    Parameters
    ----------
    config
        The lab.
    before
        What an interrupted session has brought that this one goes on with.
    """

    name = "sampler"

    def __init__(self, config: LabConfig, before: Progress | None = None) -> None:
        seed = [config.seed, SEED_STREAM]
        if before is not None:
            # Other draws than those that the session began with.
            seed.append(before.runs)
        planner = Planner(config, np.random.default_rng(np.random.SeedSequence(seed)))
        self.sampler = Sampler(config, planner, before or NOTHING)
        self._config = config
        self._farewells = 0

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._commands = Commands(port, self._config, self.name)
        guard = Guard(self._config, self._config.sampler.tracking_timeout_s)
        self._inputs = DriveInputs(port, self._config, guard, self._commands, records=True)
        SessionInfo(port, self._config, "calibrate")
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Give the robot up; the motor loop brings it to rest."""
        self._commands.release(self._port.now_us())

    def outcome(self, missed_deadlines: int = 0) -> CalibrationOutcome:
        """Return what the session has brought; who runs the node counts the deadlines."""
        sampler = self.sampler
        return CalibrationOutcome(
            complete=sampler.done == sampler.total,
            reason=sampler.reason,
            segments=sampler.done,
            segments_wanted=sampler.total,
            frames=sampler.frames,
            redraws=sampler.redraws.by_text(),
            missed_deadlines=missed_deadlines,
        )

    def _on_tick(self, tick_us: int) -> None:
        del tick_us
        now_us = self._port.now_us()
        inputs = self._inputs
        inputs.step(now_us, driving=self.sampler.driving)
        self.sampler.see_frames(inputs.valid_frames)
        frame, status = inputs.tracked(now_us), inputs.status(now_us)
        seen = Observation(
            None if frame is None else frame.pose,
            Velocity(status.v_setpoint_m_per_s, status.omega_setpoint_rad_per_s)
            if status
            else None,
            inputs.interlock or self._cut_off(status),
        )
        action = self.sampler.step(seen, now_us)
        self._commands.send(action.u, now_us)
        self._send_state(action, now_us)
        if action.phase is Phase.DONE:
            self._farewells += 1
            if self._farewells == FAREWELLS:
                self._port.finish()

    def _cut_off(self, status: lcmtypes.onboard_status_t | None) -> Interlock | None:
        """Return whether the watchdog has stopped the robot in the middle of a run."""
        if status is None or status.state != status.WATCHDOG:
            return None
        return Interlock("onboard loop: the watchdog has stopped the robot", cause=Cause.SILENCE)

    def _send_state(self, action: Action, utime: int) -> None:
        message = lcmtypes.sampler_state_t()
        message.utime = utime
        message.phase = action.phase
        message.segment, message.basis_index = action.segment, action.basis_index
        message.inputs, message.u = len(action.u), padded(action.u, message.MOST_INPUTS)
        message.segments_done, message.segments_total = self.sampler.done, self.sampler.total
        message.samples = self.sampler.frames
        message.redraws = self.sampler.redraws.total()
        message.redraws_by_reason = self.sampler.redraws.numbers()
        self._port.publish(channels.SAMPLER_STATE, message)
