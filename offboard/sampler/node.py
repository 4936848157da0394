"""Ties the sampler to the bus."""

from __future__ import annotations

import numpy as np

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.message_values import padded
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose, Velocity
from offboard.desk.commander import Commands, Freshness, SessionInfo
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
        self._fresh = Freshness(port, self._config)
        self._commands = Commands(port, self._config, self.name)
        SessionInfo(port, self._config, "calibrate")
        port.subscribe(channels.MOCAP_POSE, self._on_pose)
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Give the robot up; the motor loop brings it to rest."""
        self._commands.release(self._port.now_us())

    def outcome(self, missed_deadlines: int = 0) -> CalibrationOutcome:
        """Return what the session has brought; who runs the node counts the deadlines."""
        sampler = self.sampler
        return CalibrationOutcome(
            complete=sampler.done == sampler.total,
            segments=sampler.done,
            segments_wanted=sampler.total,
            frames=sampler.frames,
            redraws=dict(sorted(sampler.redraws.items())),
            missed_deadlines=missed_deadlines,
        )

    def _on_pose(self, message: lcmtypes.mocap_pose_t) -> None:
        if message.tracking_valid:
            self.sampler.see_frame()

    def _on_tick(self, tick_us: int) -> None:
        del tick_us
        now_us = self._port.now_us()
        frame, status = self._fresh.pose(now_us), self._fresh.onboard(now_us)
        seen = Observation(
            Pose(frame.x1_m, frame.x2_m, frame.theta_rad) if frame else None,
            Velocity(status.v_setpoint_m_per_s, status.omega_setpoint_rad_per_s)
            if status
            else None,
            self._fresh.takes_commands(self._commands.number, now_us)
            and not self._cut_off(status)
            and self._fresh.is_logging(now_us),
        )
        action = self.sampler.step(seen, now_us)
        self._commands.send(action.u, now_us)
        self._send_state(action, now_us)
        if action.phase is Phase.DONE:
            self._farewells += 1
            if self._farewells == FAREWELLS:
                self._port.finish()

    def _cut_off(self, status: lcmtypes.onboard_status_t | None) -> bool:
        """Return whether the watchdog has stopped the robot in the middle of a run."""
        return status is not None and status.state == lcmtypes.onboard_status_t.WATCHDOG

    def _send_state(self, action: Action, utime: int) -> None:
        message = lcmtypes.sampler_state_t()
        message.utime = utime
        message.phase = action.phase
        message.segment, message.basis_index = action.segment, action.basis_index
        message.inputs, message.u = len(action.u), padded(action.u, message.MOST_INPUTS)
        message.segments_done, message.segments_total = self.sampler.done, self.sampler.total
        message.samples = self.sampler.frames
        message.redraws = self.sampler.redraws.total()
        self._port.publish(channels.SAMPLER_STATE, message)
