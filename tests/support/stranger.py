"""Rows of a stranger's package, one a table; a test writes this file into a package of its own."""

import json
import sys

import lcmtypes
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import ENCODER, MOCAP_POSE, MOTOR_CMD
from koopman_lab.bus.hardware import Hardware
from koopman_lab.bus.processes import Process
from koopman_lab.data.formats.decoded import Exported, decoded
from koopman_lab.data.formats.table import LogFormat

BEACON_STATE = Channel("BEACON_STATE", lcmtypes.logger_status_t, 5.0, "beacon")
BEACON = Process("beacon", "stranger:Beacon", needs=("onboard",), channels=(BEACON_STATE,))
ACME_MOTORS = Hardware("acme", "stranger:Motors", "driver", needs="a board on a serial port")
ACME_CAMERAS = Hardware("acme", "stranger:Cameras", "mocap", needs="cameras")


def write_counts(events, path):
    """Write how many messages each channel has."""
    written = Exported.nothing()
    for entry in decoded(events, written):
        written.keep(entry.event.channel)
    path.write_text(json.dumps(written.channels))
    return written


COUNTS = LogFormat("counts", "numbers of messages", ".counts", write_counts)


class Beacon:
    """Says on a channel of its own that it is there, five times a second."""

    name = "beacon"

    def __init__(self, config):
        self.robot = config.robot.name

    def attach(self, port):
        self._port = port
        port.every(5.0, self._say)

    def _say(self, tick_us):
        state = lcmtypes.logger_status_t()
        state.utime, state.events = tick_us, 1
        self._port.publish(BEACON_STATE, state)

    def close(self):
        sys.stdout.write(f"beacon of {self.robot} ends\n")


class Motors:
    """A board whose counters follow the duty at once: 1000 counts a second at full duty."""

    name = "driver"

    def __init__(self, config):
        self._rate_hz = config.motor_loop.rate_hz
        self._duty = self._counts = (0.0, 0.0)

    def attach(self, port):
        self._port = port
        port.subscribe(MOTOR_CMD, self._drive)
        port.every(self._rate_hz, self._count)

    def _drive(self, command):
        self._duty = command.left_duty, command.right_duty

    def _count(self, tick_us):
        self._counts = tuple(
            c + 1000.0 * d / self._rate_hz for c, d in zip(self._counts, self._duty, strict=True)
        )
        encoder = lcmtypes.encoder_t()
        encoder.utime, encoder.battery_v = tick_us, 12.0
        encoder.left_count, encoder.right_count = map(int, self._counts)
        self._port.publish(ENCODER, encoder)

    def close(self):
        """Nothing is held."""


class Cameras:
    """Cameras that see the robot stand at (1 m, 2 m, 0.5 rad)."""

    name = "mocap"

    def __init__(self, config):
        self._rate_hz = config.mocap.rate_hz

    def attach(self, port):
        self._port = port
        port.every(self._rate_hz, self._see)

    def _see(self, tick_us):
        pose = lcmtypes.mocap_pose_t()
        pose.utime, pose.tracking_valid = tick_us, True
        pose.x1_m, pose.x2_m, pose.theta_rad = 1.0, 2.0, 0.5
        self._port.publish(MOCAP_POSE, pose)

    def close(self):
        """Nothing is held."""
