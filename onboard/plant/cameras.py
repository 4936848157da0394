"""The motion-capture cameras: noise, lost frames, latency."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from koopman_lab.config.schema import Mocap
from koopman_lab.geometry import Pose, wrap_angle
from koopman_lab.units import US_PER_S


class Frame(NamedTuple):
    """What the tracking makes of one exposure; an invalid frame has no usable pose."""

    utime: int
    pose: Pose
    valid: bool


class Cameras:
    """Exposes true poses and hands them out once the processing latency has passed."""

    def __init__(self, mocap: Mocap, rng: np.random.Generator) -> None:
        self._position_noise_m = mocap.position_noise_m
        self._angle_noise_rad = mocap.angle_noise_rad
        self._lost_share = mocap.lost_frame_share
        self._latency_us = round(mocap.latency_s * US_PER_S)
        self._rng = rng
        self._pending: deque[Frame] = deque()

    def expose(self, utime: int, pose: Pose) -> None:
        """Take a picture of the true pose at ``utime``."""
        e1, e2, e3 = self._rng.standard_normal(3).tolist()
        valid = self._lost_share == 0.0 or self._rng.random() >= self._lost_share
        seen = Pose(
            pose.x1 + self._position_noise_m * e1,
            pose.x2 + self._position_noise_m * e2,
            wrap_angle(pose.theta + self._angle_noise_rad * e3),
        )
        self._pending.append(Frame(utime, seen if valid else Pose(0.0, 0.0, 0.0), valid))

    def ready(self, now_us: int) -> list[Frame]:
        """Return the frames whose latency has passed by ``now_us``, oldest first."""
        frames = []
        while self._pending and self._pending[0].utime + self._latency_us <= now_us:
            frames.append(self._pending.popleft())
        return frames
