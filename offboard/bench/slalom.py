"""A node that keeps the robot under way for as long as something is measured."""

from __future__ import annotations

import math

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import REST, Velocity
from koopman_lab.robots.table import robot_type
from offboard.desk.commander import Commands
from offboard.sampler.profile import slew

LARGEST_A = 1.0
"""Of the weave, m/s^2."""


class Slalom:
    """Drives along a weave that never stands still, in the operator's role."""

    name = "slalom"

    def __init__(self, config: LabConfig) -> None:
        self._config = config
        self._drive = robot_type(config.robot.kind).on_two_wheels("the slalom")
        self._velocity = REST
        self.driving = False
        """Whether the motor loop last said that it drives."""

    def attach(self, port: Port) -> None:
        """Listen to the motor loop and set the control timer."""
        port.subscribe(channels.ONBOARD_STATUS, self._on_status)
        self._commands = Commands(port, self._config, self.name)
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Nothing is held."""

    def _on_status(self, message: lcmtypes.onboard_status_t) -> None:
        self.driving = message.state == message.DRIVING
        if not self.driving:
            self._velocity = REST

    def _on_tick(self, tick_us: int) -> None:
        seconds = tick_us * 1e-6
        weave = Velocity(0.2 + 0.1 * math.sin(seconds), 0.8 * math.sin(0.7 * seconds))
        dt_s, before = self._config.controller.dt_s, self._velocity
        # From rest to the weave takes longer than one interval.
        self._velocity = Velocity(slew(before.v, weave.v, LARGEST_A * dt_s), weave.omega)
        self._commands.send(self._drive.input_towards(before, self._velocity, dt_s), tick_us)
