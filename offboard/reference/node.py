"""Ties the driver of reference runs to the bus."""

from __future__ import annotations

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.commanders import NOBODY
from koopman_lab.bus.message_values import padded
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from offboard.desk.commander import Commands, SessionInfo
from offboard.desk.drive_inputs import DriveInputs
from offboard.desk.guard import Guard
from offboard.desk.placing import reset_message
from offboard.desk.results import ReferenceOutcome
from offboard.reference.reference_driver import Action, Observation, Phase, ReferenceDriver
from offboard.reference.shapes import Shape, input_sequence, start_pose

FAREWELLS = 4
"""The last state is sent this often, so that losing one message loses nothing."""
AT_REST = 1e-6
"""Of a set-point, m/s and rad/s."""


class ReferenceNode:
    """Listens to poses and to who is alive; places and commands the robot, says REFERENCE_STATE.

    Parameters
    ----------
    config
        The lab.
    shape
        Of the runs.

    Raises
    ------
    ConfigError
        If the shape cannot be driven as configured.
    """

    name = "reference"

    def __init__(self, config: LabConfig, shape: Shape) -> None:
        inputs = input_sequence(config, shape)
        self.driver = ReferenceDriver(
            config, start_pose(config, shape), inputs, config.reference.runs
        )
        self._shape = shape
        self._config = config
        self._farewells = 0

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._commands = Commands(port, self._config, self.name)
        guard = Guard(self._config, self._config.sampler.tracking_timeout_s)
        self._inputs = DriveInputs(port, self._config, guard, self._commands, records=True)
        SessionInfo(port, self._config, "reference")
        port.every(1.0 / self._config.controller.dt_s, self._on_tick)

    def close(self) -> None:
        """Give the robot up; the motor loop brings it to rest."""
        self._commands.release(self._port.now_us())

    def outcome(self, missed_deadlines: int = 0) -> ReferenceOutcome:
        """Return what the session has brought; who runs the node counts the deadlines."""
        driver = self.driver
        return ReferenceOutcome(
            shape=self._shape.name.lower(),
            complete=driver.done == driver.total,
            reason=driver.reason,
            runs=driver.done,
            runs_wanted=driver.total,
            steps=len(driver.inputs),
            repeated=dict(sorted(driver.repeated.items())),
            missed_deadlines=missed_deadlines,
        )

    def _on_tick(self, tick_us: int) -> None:
        del tick_us
        now_us, number = self._port.now_us(), self._commands.number
        self._inputs.step(now_us, driving=self.driver.phase is Phase.RUN)
        frame, status = self._inputs.tracked(now_us), self._inputs.status(now_us)
        seen = Observation(
            None if frame is None else frame.pose,
            0 if frame is None else frame.utime,
            self._inputs.interlock,
            status is not None and status.commander == number,
            status is not None
            and status.commander == NOBODY
            and max(abs(status.v_setpoint_m_per_s), abs(status.omega_setpoint_rad_per_s)) < AT_REST,
        )
        action = self.driver.step(seen, now_us)
        if action.u is not None:
            self._commands.send(action.u, now_us)
        elif action.release:
            self._commands.release_if_held(now_us)
        if action.place:
            self._port.publish(channels.PLANT_RESET, reset_message(self.driver.start, now_us))
        self._send_state(action, now_us)
        if action.phase is Phase.DONE:
            self._farewells += 1
            if self._farewells == FAREWELLS:
                self._port.finish()

    def _send_state(self, action: Action, utime: int) -> None:
        driver, message = self.driver, lcmtypes.reference_state_t()
        message.utime = utime
        message.phase, message.shape = action.phase, self._shape
        message.run, message.step, message.steps = action.run, action.step, len(driver.inputs)
        u = action.u or (0.0,) * len(driver.inputs[0])
        message.inputs, message.u = len(u), padded(u, message.MOST_INPUTS)
        message.runs_done, message.runs_total = driver.done, driver.total
        message.start_x1_m, message.start_x2_m, message.start_theta_rad = driver.start
        self._port.publish(channels.REFERENCE_STATE, message)
