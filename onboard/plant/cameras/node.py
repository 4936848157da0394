"""Ties the plant's cameras to the bus; real cameras replace exactly this."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

import lcmtypes
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
        frames = self._cameras.ready(now_us)
        if not frames:
            return
        lies = self._lies
        utime, pose, valid = frames[-1]
        if utime < lies.from_us:
            if valid:
                lies.last_pose = pose
            self._send(frames, self._messages.numbered)
            return
        for frame in frames:
            told = lies.told(frame)
            self._send(told, self._messages.message(stuck=lies.sequence_stuck))

    def _send(self, frames: Sequence[Frame], seen: lcmtypes.mocap_pose_t) -> None:
        for seen.utime, pose, seen.tracking_valid in frames:
            seen.x1_m, seen.x2_m, seen.theta_rad = pose
            self._port.publish(channels.MOCAP_POSE, seen)
