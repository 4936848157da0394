"""The onboard program's node: ties the motor loop to the bus."""

from __future__ import annotations

import struct

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.bus.node import Port
from koopman_lab.bus.stamp_gate import StampGate
from koopman_lab.config.schema import LabConfig
from koopman_lab.eventlog.older_layouts import in_present_layout
from koopman_lab.geometry.planar import body_velocity
from koopman_lab.robots.table import robot_type
from onboard.desk_time import DeskTime
from onboard.motor_loop.command_arbiter import Command, Intent
from onboard.motor_loop.loop import MotorLoop
from onboard.motor_loop.stop_keeper import StopKeeper, StopStore
from onboard.second_loop import SecondLoop


class OnboardNode:
    """Listens to commands, ESTOP and ENCODER; speaks MOTOR_CMD, WHEEL_STATE, ONBOARD_STATUS.

    Parameters
    ----------
    config
        The lab.
    stops
        Where a stop is written down, by a program of its own on a board; it then also listens for
        another one that speaks for its robot. None where nothing can outlast the node.
    """

    name = "onboard"

    def __init__(self, config: LabConfig, stops: StopStore | None = None) -> None:
        self.loop = MotorLoop(config)
        self._keeper = None if stops is None else StopKeeper(self.loop, stops)
        self._second_loop: SecondLoop | None = None
        self._config = config
        self._robot = config.robot
        self._command = robot_type(config.robot.kind).commanded()
        self._rates = config.motor_loop
        self._duties = lcmtypes.motor_command_t()
        self._encoder_gate = StampGate(channels.ENCODER)

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._ticked_us = port.now_us()
        self._time = DeskTime(port, self._config)
        port.subscribe(channels.ENCODER, self._on_encoder)
        port.subscribe_raw(channels.ESTOP, self._on_estop)
        for channel in channels.wheel_command_channels():
            port.subscribe_raw(channel, self._on_command)
        if self._keeper is not None:
            self._keeper.begin(port.now_us())
            self._second_loop = SecondLoop(port, self._time, self._on_second_loop)
        port.every(self._rates.rate_hz, self._on_tick)
        port.every(self._rates.wheel_state_rate_hz, self._on_wheel_state_tick)
        port.every(self._rates.status_rate_hz, self._on_status_tick)

    def close(self) -> None:
        """Leave the motors at zero."""
        self._send_duties(0.0, 0.0, self._port.now_us())

    def _on_encoder(self, message: lcmtypes.encoder_t) -> None:
        # The tick before is near enough, and costs no look at the clock.
        if not self._encoder_gate.admits(message.utime, self._ticked_us):
            return
        self.loop.encoder(message.utime, message.left_count, message.right_count, message.battery_v)

    def _on_estop(self, name: str, data: bytes, arrived_us: int) -> None:
        del name
        try:
            # A kill switch that was built for an older version stops the robot as well.
            message = lcmtypes.estop_t.decode(in_present_layout(data))
        except (ValueError, struct.error):
            return
        ordered_us = self._time.to_board(message.utime)
        if message.engaged:
            self.loop.stop(arrived_us, ordered_us)
        else:
            self.loop.release(message.stop_number, ordered_us)

    def _on_command(self, name: str, data: bytes, arrived_us: int) -> None:
        del name
        try:
            command = self._decode(data)
        except (ValueError, struct.error):
            self.loop.refuse_type()
            return
        utime = self._time.to_board(command.utime)
        self.loop.command(command._replace(utime=utime), arrived_us)

    def _decode(self, data: bytes) -> Command:
        # The fingerprint decides: another robot's type raises ValueError here.
        m = self._command.type.decode(data)
        u1, u2 = self._command.decode(m)
        return Command(m.utime, m.sequence, m.commander, Intent(m.intent), u1, u2)

    def _on_tick(self, tick_us: int) -> None:
        self._ticked_us = tick_us
        left, right = self.loop.tick(tick_us)
        self._send_duties(left, right, tick_us)
        if self._keeper is not None:
            self._keeper.keep(tick_us)

    def _on_second_loop(self, now_us: int) -> None:
        # Once said it holds until a person releases it: nobody else knows when the other is gone.
        if self.loop.fault != Fault.SECOND_LOOP:
            self.loop.hold(Fault.SECOND_LOOP, now_us)

    def _send_duties(self, left: float, right: float, utime: int) -> None:
        # Encoded as soon as it is filled, so that one does.
        message = self._duties
        message.utime = self._time.to_desk(utime)
        message.left_duty, message.right_duty = left, right
        self._port.publish(channels.MOTOR_CMD, message)

    def _on_wheel_state_tick(self, tick_us: int) -> None:
        del tick_us
        mean = self.loop.odometry.mean()
        if mean is None:
            return
        message = lcmtypes.wheel_state_t()
        message.utime, message.window_s = self._time.to_desk(mean.utime), mean.window_s
        message.left_rad_per_s, message.right_rad_per_s = mean.left, mean.right
        message.v_m_per_s, message.omega_rad_per_s = body_velocity(
            mean.left, mean.right, self._robot.wheel_radius_m, self._robot.track_width_m
        )
        self._port.publish(channels.WHEEL_STATE, message)

    def _on_status_tick(self, tick_us: int) -> None:
        loop, arbiter = self.loop, self.loop.arbiter
        if self._keeper is not None:
            self._keeper.keep(tick_us)
        refused = arbiter.counts.refused
        message = lcmtypes.onboard_status_t()
        message.utime = self._time.to_desk(tick_us)
        message.state = loop.state
        message.fault = loop.fault
        message.commander = arbiter.holder
        message.refused_commander_last = arbiter.refused_last
        message.v_setpoint_m_per_s, message.omega_setpoint_rad_per_s = loop.setpoint
        message.accepted = arbiter.counts.accepted
        message.refused_value = refused["value"]
        message.refused_stale = refused["stale"]
        message.refused_order = refused["order"]
        message.refused_commander = refused["commander"]
        message.refused_type = refused["type"]
        message.refused_stopped = refused["stopped"]
        message.stop_number = loop.stop_latch.number
        message.refused_release = loop.stop_latch.refused_releases
        message.battery_v = loop.battery_v or 0.0
        self._port.publish(channels.ONBOARD_STATUS, message)
        if self._second_loop is not None:
            self._second_loop.remember(message)
