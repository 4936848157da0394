"""What a node that drives the robot hears, and whether it may drive by it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.age import is_current, is_fresh
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.commanders import commander_name
from koopman_lab.bus.motor_loop_faults import why_stopped
from koopman_lab.bus.node import Port
from koopman_lab.bus.publishers import NamedIdentity, identity_faults
from koopman_lab.bus.stamp_gate import StampGate
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import ORIGIN, Pose, Velocity, compose, relative_to
from koopman_lab.units import US_PER_S
from offboard.desk.camera_stream import CameraStream
from offboard.desk.commander import ONBOARD_TIMEOUT_S, Commands
from offboard.desk.guard import OLDEST_WHEELS_US, Guard
from offboard.desk.interlock import Cause, Interlock
from offboard.desk.measurements import Frame, WheelSpeeds
from offboard.desk.wakefulness import Wakefulness

LOGGER_TIMEOUT_S = 2.0
"""Four of its heartbeats."""
SAY_AGAIN_US = 500_000
"""So often is said why the robot is not driven."""

LOOK_US = 400_000
"""So often is looked whether somebody else speaks for the robot."""
WATCHED: tuple[Channel[Any], ...] = (
    *(channels.MOCAP_POSE, channels.WHEEL_STATE),
    channels.ONBOARD_STATUS,
)
"""What tells of the robot."""
KEYLESS_US = 1_000_000
"""So long after a message without the lab's key that is said."""
LISTEN_US = 800_000
"""Eight messages of the slowest: in which a second speaker has had its turns."""
LISTENING = Interlock("listening whether one program speaks for the robot", cause=Cause.STREAM)
NOTHING = Interlock("")


class DriveInputs:
    """The newest frames, wheels, status and heartbeats, and the guard's judgement of them.

    Parameters
    ----------
    port, config
        Of the node.
    guard
        Judges the motion.
    commands
        Of who drives.
    marker_offset
        Pose of the tracked frame on the robot, where it is known: poses are then the robot's.
    records
        Whether every frame is needed, because a data set is made of them.
    """

    def __init__(
        self,
        port: Port,
        config: LabConfig,
        guard: Guard,
        commands: Commands,
        *,
        marker_offset: Pose = ORIGIN,
        records: bool = False,
    ) -> None:
        self.guard = guard
        self.frame: Frame | None = None
        """Believed in the last step; None if none was."""
        self.wheels: WheelSpeeds | None = None
        """The newest wheel odometry."""
        self.valid_frames = 0
        """Number of frames since the step before in which the cameras saw the robot."""
        self.interlock: Interlock | None = None
        """Why the robot must not be driven in this step."""
        self._port, self._config = port, config
        self._commander, self._commands = commands.number, commands
        self._wakefulness = Wakefulness(config.commander.standstill_limit_s)
        self._robot_in_tracked_frame = relative_to(marker_offset, ORIGIN)
        self._has_offset = marker_offset != ORIGIN
        self._poses: list[lcmtypes.mocap_pose_t] = []
        self._pose_gate = StampGate(channels.MOCAP_POSE)
        self._wheel_gate = StampGate(channels.WHEEL_STATE)
        self._status_gate = StampGate(channels.ONBOARD_STATUS)
        self._logger_gate = StampGate(channels.LOGGER_STATUS)
        self._status: lcmtypes.onboard_status_t | None = None
        self._logger: lcmtypes.logger_status_t | None = None
        self._status_new_us = self._logger_new_us = 0
        self._others: Interlock | None = None
        self._looked_us = -LOOK_US
        self._listening_since_us: int | None = None
        self._keyless: dict[str, tuple[int, int]] = {}
        """By channel how many messages lacked the key, and when the newest did (us)."""
        self._said = ""
        self._said_us = 0
        mocap = channels.MOCAP_POSE.name(config.robot.name)
        self._stream = CameraStream(mocap, config.mocap.rate_hz) if records else None
        port.subscribe(channels.MOCAP_POSE, self._poses.append)
        port.subscribe(channels.WHEEL_STATE, self._on_wheels)
        port.subscribe(channels.ONBOARD_STATUS, self._on_status)
        port.subscribe(channels.LOGGER_STATUS, self._on_logger)

    def step(self, now_us: int, *, driving: bool) -> None:
        """Judge what has come since the last step."""
        self._wakefulness.step(now_us)
        poses = self._poses
        if self._stream is not None:
            plausible = [m for m in poses if self._pose_gate.admits(m.utime, now_us)]
            self._stream.take(plausible)
            self.valid_frames = sum(message.tracking_valid for message in plausible)
        self.frame = self.guard.see_frames(self._newest_first(), now_us, driving=driving)
        poses.clear()
        # Asked in any case: from it the guard knows when a drive begins and ends.
        motion = self.guard.interlock(now_us, driving=driving)
        self.interlock = (
            self._failure() or self._silence(now_us) or self._second_publisher(now_us) or motion
        )
        if self.interlock is None and self._stream is not None:
            complaint = self._stream.complaint()
            if complaint is not None:
                self.interlock = Interlock(complaint, cause=Cause.STREAM)
        if self.interlock is not None and self.interlock.cause in (Cause.SILENCE, Cause.TRACKING):
            self.interlock = self._with_keyless(self.interlock, now_us)
        if self._said or self.interlock is not None:
            self._say(self.interlock or NOTHING, now_us)

    def tracked(self, now_us: int) -> Frame | None:
        """Return the newest frame that can be believed, None while tracking is lost."""
        return self.guard.tracked(now_us)

    def status(self, now_us: int) -> lcmtypes.onboard_status_t | None:
        """Return the newest status of the motor loop, None while it is silent."""
        status, limit_us = self._status, ONBOARD_TIMEOUT_S * US_PER_S
        if status is None or not is_fresh(status.utime, self._status_new_us, now_us, limit_us):
            return None
        return status

    def _failure(self) -> Interlock | None:
        """Return why this program cannot go on to drive; it stays so."""
        complaint = self._wakefulness.complaint or self._commands.refused.complaint
        return Interlock(complaint, lasting=True, cause=Cause.COMMANDER) if complaint else None

    def _silence(self, now_us: int) -> Interlock | None:
        """Return why the motor loop would take no commands, or nobody would write them down."""
        status = self.status(now_us)
        if status is None:
            clock = self._status_gate.complaint(now_us)
            return Interlock(clock or "onboard loop silent", cause=Cause.SILENCE)
        why = why_stopped(status)
        if why is not None:
            return Interlock(f"onboard loop stopped: {why}", lasting=True, cause=Cause.HELD)
        if status.commander not in (0, self._commander):
            holder = commander_name(status.commander)
            held = f"onboard loop held by {holder}"
            return Interlock(held, lasting=True, cause=Cause.HELD)
        logger, limit_us = self._logger, LOGGER_TIMEOUT_S * US_PER_S
        if logger is None or not is_fresh(logger.utime, self._logger_new_us, now_us, limit_us):
            clock = self._logger_gate.complaint(now_us)
            return Interlock(clock or "logger silent", cause=Cause.SILENCE)
        if logger.bytes == logger.NOT_WRITING:
            return Interlock(
                "the logger cannot write the session down; its last words say why",
                lasting=True,
                cause=Cause.RECORD,
            )
        # Without its stamps the wheels count as lost; what is lost is said, before who needs it.
        clock = self._wheel_gate.complaint(now_us)
        return (
            Interlock(clock, cause=Cause.SILENCE) if clock and self._lacks_wheels(now_us) else None
        )

    def _lacks_wheels(self, now_us: int) -> bool:
        """Return whether the newest usable odometry is too old for its clock to be right now."""
        wheels = self.wheels
        return wheels is None or not is_current(wheels.utime, now_us, OLDEST_WHEELS_US)

    def _with_keyless(self, interlock: Interlock, now_us: int) -> Interlock:
        """Add on which channels messages lack the lab's key: a process may be without it."""
        for channel in (*WATCHED, channels.LOGGER_STATUS):
            count = self._port.without_key(channel)
            name = channel.name(self._config.robot.name)
            if count > self._keyless.get(name, (0, 0))[0]:
                self._keyless[name] = count, now_us
        names = [n for n, (_, at_us) in self._keyless.items() if now_us - at_us <= KEYLESS_US]
        if not names:
            return interlock
        keyless = f"messages without the lab's key on {', '.join(names)}"
        return interlock._replace(reason=f"{interlock.reason}; {keyless}")

    def _say(self, interlock: Interlock, now_us: int) -> None:
        """Publish what forbids driving, as soon as it changes and now and then."""
        if interlock.reason == self._said and now_us - self._said_us < SAY_AGAIN_US:
            return
        self._said, self._said_us = interlock.reason, now_us
        message = lcmtypes.interlock_t()
        message.utime, message.commander = now_us, self._commander
        message.lasting, message.reason = interlock.lasting, interlock.reason
        self._port.publish(channels.INTERLOCK, message)

    def _second_publisher(self, now_us: int) -> Interlock | None:
        """Return who else uses the robot's name, as of the last look.

        Two that speak at once are told apart only after a while, so that is waited for.
        """
        if self._listening_since_us is None:
            self._listening_since_us = now_us
        if now_us - self._listening_since_us < LISTEN_US:
            return LISTENING
        if not is_current(self._looked_us, now_us, LOOK_US):
            self._looked_us = now_us
            streams = [
                NamedIdentity(
                    channel.name(self._config.robot.name),
                    channel,
                    self._port.publishers(channel),
                    nominal_hz=channel.rate_hz(self._config),
                )
                for channel in WATCHED
            ]
            faults = "; ".join(identity_faults(streams))
            self._others = Interlock(faults, cause=Cause.STREAM) if faults else None
        return self._others

    def _newest_first(self) -> Iterator[Frame]:
        for message in reversed(self._poses):
            pose = Pose(message.x1_m, message.x2_m, message.theta_rad)
            # What is no number passes as it is: the guard refuses it.
            if self._has_offset and all(map(math.isfinite, pose)):
                pose = compose(pose, self._robot_in_tracked_frame)
            yield Frame(message.utime, pose, message.tracking_valid)

    def _on_wheels(self, message: lcmtypes.wheel_state_t) -> None:
        if not self._wheel_gate.admits(message.utime, self._port.now_us()):
            return
        velocity = Velocity(message.v_m_per_s, message.omega_rad_per_s)
        self.wheels = WheelSpeeds(message.utime, velocity)
        self.guard.see_wheels(self.wheels)

    def _on_status(self, status: lcmtypes.onboard_status_t) -> None:
        now_us = self._port.now_us()
        if not self._status_gate.admits(status.utime, now_us):
            return
        if self._status is None or status.utime != self._status.utime:
            self._status_new_us = now_us
        self._status = status
        setpoint = Velocity(status.v_setpoint_m_per_s, status.omega_setpoint_rad_per_s)
        self.guard.see_setpoint(setpoint, now_us)

    def _on_logger(self, message: lcmtypes.logger_status_t) -> None:
        now_us = self._port.now_us()
        if not self._logger_gate.admits(message.utime, now_us):
            return
        if self._logger is None or message.utime != self._logger.utime:
            self._logger_new_us = now_us
        self._logger = message
