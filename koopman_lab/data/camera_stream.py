"""How the frames of the cameras came: their rate, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.segments import in_time
from koopman_lab.units import US_PER_S

LONGEST_PAUSE_S = 1.0
"""A longer step from frame to frame is a session that was interrupted, or a clock that was set."""


@dataclass(frozen=True)
class CameraStream:
    """Counts of frames, and their rates.

    Attributes
    ----------
    frames
        Frames with a time of their own, valid or not.
    rate_hz
        How often the cameras took one, those included that were lost on the way by their numbers;
        pauses are left out. None where there is only one instant.
    configured_hz
        As ``mocap.rate_hz`` says.
    invalid
        Frames without a valid pose.
    lost
        Frames that the numbers show missing.
    """

    frames: int
    rate_hz: float | None
    configured_hz: float
    invalid: int
    lost: int


def camera_stream(messages: StructuredArray, configured_hz: float) -> CameraStream:
    """Return how messages of MOCAP_POSE (N,) came."""
    frames = in_time(messages)
    steps_us, numbers = np.diff(frames["utime"]), np.diff(frames["sequence"])
    together = steps_us <= LONGEST_PAUSE_S * US_PER_S
    span_us = int(steps_us[together].sum())
    # Where frames come one after another at about their distance, numbers tell what is between.
    per_frame_us = US_PER_S / configured_hz
    missing = np.minimum(numbers - 1, np.rint(steps_us / per_frame_us).astype(np.int64) - 1)
    lost = int(np.maximum(missing[together], 0).sum())
    return CameraStream(
        frames=len(frames),
        rate_hz=(int(together.sum()) + lost) * US_PER_S / span_us if span_us else None,
        configured_hz=configured_hz,
        invalid=int(np.count_nonzero(~frames["tracking_valid"])),
        lost=lost,
    )
