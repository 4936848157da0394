"""Ties the plant's cameras to the bus; real cameras replace exactly this."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import PlainPose
from onboard.plant.cameras.cameras import Cameras, Frame
from onboard.plant.cameras.lies import Lies
from onboard.plant.cameras.pose_messages import PoseMessages


class Scene(Protocol):
    """What simulated cameras look at: a robot whose true motion is known, in the same process."""

    after_tick: list[Callable[[int], None]]
    """Called with the time (us) after each tick of the robot's own."""

    def look(self, now_us: int) -> tuple[int, PlainPose, bool]:
        """Move on to ``now_us`` and return what there is to see.

        Returns
        -------
        The time (us) at which the robot then is, its true pose (m, m, rad), and whether somebody
        stands between it and the cameras.
        """


class SimulatedCameras:
    """Listens to FAULT, for the lies; speaks MOCAP_POSE.

    Parameters
    ----------
    config
        The lab; something must be simulated.
    scene
        What the cameras look at; attached before them.
    """

    name = "plant"

    def __init__(self, config: LabConfig, scene: Scene) -> None:
        # The second of the two generators of a plant; the other one is its robot's.
        noise = np.random.SeedSequence([config.seed, 1], spawn_key=(1,))
        self._simulation = config.require_simulation()
        self._cameras = Cameras(self._simulation.cameras, np.random.default_rng(noise))
        self._rate_hz = config.mocap.rate_hz
        self._scene = scene
        self._messages = PoseMessages()

    def attach(self, port: Port) -> None:
        """Register the timer."""
        self._port = port
        self._lies = lies = Lies(self._simulation.faults, port.now_us())
        port.subscribe(channels.FAULT, lambda message: lies.obey(message, port.now_us()))
        port.every(self._rate_hz, self._on_tick)
        # Frames become ready between exposures, so these ticks ask for them as well.
        self._scene.after_tick.append(self._send_frames)

    def close(self) -> None:
        """Nothing is held."""

    def _on_tick(self, tick_us: int) -> None:
        utime, pose, hidden = self._scene.look(tick_us)
        self._cameras.expose(utime, pose, hidden=hidden)
        self._send_frames(utime)

    def _send_frames(self, now_us: int) -> None:
        lies, seen = self._lies, self._messages.numbered
        for frame in self._cameras.ready(now_us):
            if frame[0] >= lies.from_us:
                self._tell(frame)
                continue
            seen.utime, pose, valid = frame
            seen.x1_m, seen.x2_m, seen.theta_rad = pose
            seen.tracking_valid = valid
            if valid:
                lies.last_pose = pose
            self._port.publish(channels.MOCAP_POSE, seen)

    def _tell(self, frame: Frame) -> None:
        """Send what the lies make of a frame."""
        told = self._lies.told(frame)
        seen = self._messages.message(stuck=self._lies.sequence_stuck)
        for seen.utime, pose, seen.tracking_valid in told:
            seen.x1_m, seen.x2_m, seen.theta_rad = pose
            self._port.publish(channels.MOCAP_POSE, seen)
