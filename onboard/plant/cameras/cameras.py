"""The motion-capture cameras: marker frame, noise, lost frames, occlusions, latency."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from math import cos, sin

import numpy as np

from koopman_lab.config import simulation
from koopman_lab.geometry.planar import PlainPose, wrap_angle
from koopman_lab.units import US_PER_S

NOTHING: PlainPose = (0.0, 0.0, 0.0)
FRAMES_PER_DRAW = 256
"""Random numbers are drawn for many frames at once: one at a time costs more than all the rest."""


Frame = tuple[int, PlainPose, bool]
"""What the tracking makes of one exposure: its time (us), the pose, and whether that is valid."""
Numbers = tuple[Sequence[float], bool, int]
"""Random numbers of one frame: errors of its pose, whether it is lost, and its delay (us)."""


class Cameras:
    """Exposes true poses and hands out what they see once the processing latency has passed.

    Frames keep their order: one that takes long holds back those behind it.
    """

    def __init__(self, settings: simulation.Cameras, rng: np.random.Generator) -> None:
        self._marker = settings.marker_offset
        self._occlusions_per_s = settings.occlusions_per_s
        self._occlusion_s = settings.occlusion_s
        self._hidden_from_us: int | None = None
        self._hidden_until_us = 0
        noise, occlusions = rng.spawn(2)
        self._numbers = chain.from_iterable(_draws(settings, noise))
        self._occlusions = occlusions
        self._pending: deque[tuple[int, Frame]] = deque()
        self._last_ready_us = 0

    def expose(self, utime: int, pose: PlainPose, *, hidden: bool = False) -> None:
        """Take a picture of the robot at its true pose at ``utime``; of nothing if it is hidden."""
        errors, lost, delay_us = next(self._numbers)
        unseen = hidden or lost or (self._occlusions_per_s and self._occluded(utime))
        ready_us = utime + delay_us
        if ready_us < self._last_ready_us:
            ready_us = self._last_ready_us
        self._last_ready_us = ready_us
        seen = NOTHING if unseen else self._see(pose, errors)
        self._pending.append((ready_us, (utime, seen, not unseen)))

    def ready(self, now_us: int) -> list[Frame]:
        """Return the frames whose latency has passed by ``now_us``, oldest first."""
        pending, frames = self._pending, []
        while pending and pending[0][0] <= now_us:
            frames.append(pending.popleft()[1])
        return frames

    def _see(self, pose: PlainPose, errors: Sequence[float]) -> PlainPose:
        """Return what the tracking makes of a true pose."""
        x1, x2, theta = pose
        e1, e2, e3 = errors
        ahead_m, left_m, turn_rad = self._marker
        c, s = cos(theta), sin(theta)
        return (
            x1 + c * ahead_m - s * left_m + e1,
            x2 + s * ahead_m + c * left_m + e2,
            wrap_angle(theta + turn_rad + e3),
        )

    def _occluded(self, utime: int) -> bool:
        """Return whether something stands in the way; that happens at random moments."""
        if self._hidden_from_us is None or utime >= self._hidden_until_us:
            gap_s = self._occlusions.exponential(1.0 / self._occlusions_per_s)
            self._hidden_from_us = utime + round(gap_s * US_PER_S)
            length_s = self._occlusions.uniform(*self._occlusion_s)
            self._hidden_until_us = self._hidden_from_us + round(length_s * US_PER_S)
        return utime >= self._hidden_from_us


def _draws(settings: simulation.Cameras, rng: np.random.Generator) -> Iterator[Iterable[Numbers]]:
    """Yield the random numbers of the next frames, many at once."""
    spread = np.array(
        [settings.position_noise_m, settings.position_noise_m, settings.angle_noise_rad]
    )
    latency_us, jitter_us = (
        round(settings.latency_s * US_PER_S),
        settings.latency_jitter_s * US_PER_S,
    )
    while True:
        errors = spread * rng.standard_normal((FRAMES_PER_DRAW, 3))
        chances = rng.random((FRAMES_PER_DRAW, 2))
        lost = chances[:, 0] < settings.lost_frame_share
        delays_us = latency_us + np.rint(jitter_us * chances[:, 1]).astype(np.int64)
        yield zip(errors.tolist(), lost.tolist(), delays_us.tolist(), strict=True)
