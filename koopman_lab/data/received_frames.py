"""How the frames of the cameras came: their rate, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.publishers import LARGEST_SHARE, Numbering, StreamIdentity
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.data.segments import in_time
from koopman_lab.units import US_PER_S

LARGEST_SHARE_OF_ONE = 0.75
"""Of equal numbers in a row; two publishers that started together say every number twice."""
FEW = 0.1
"""Share of numbers that go back, or stay, as after restarts."""
LARGEST_PACE = 1.5
LONGEST_PAUSE_S = 1.0
"""A longer step from frame to frame is a session that was interrupted, or a clock that was set."""


@dataclass(frozen=True)
class ReceivedFrames:
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
    publishers, numbering
        How many spoke at once, and how they numbered their frames, as
        :class:`~koopman_lab.bus.publishers.StreamIdentity` has it; by the stamps alone, whenever
        the frames arrived.
    """

    frames: int
    rate_hz: float | None
    configured_hz: float
    invalid: int
    lost: int
    publishers: int = 1
    numbering: Numbering = "counts"


def received_frames(messages: StructuredArray, configured_hz: float) -> ReceivedFrames:
    """Return how messages of MOCAP_POSE (N,) came."""
    frames = in_time(messages)
    steps_us, numbers = np.diff(frames["utime"]), np.diff(frames["sequence"])
    together = steps_us <= LONGEST_PAUSE_S * US_PER_S
    span_us = int(steps_us[together].sum())
    # Where frames come one after another at about their distance, numbers tell what is between.
    per_frame_us = US_PER_S / configured_hz
    missing = np.minimum(numbers - 1, np.rint(steps_us / per_frame_us).astype(np.int64) - 1)
    lost = int(np.maximum(missing[together], 0).sum())
    rate_hz = (int(together.sum()) + lost) * US_PER_S / span_us if span_us else None
    repeated = (len(messages) - len(frames)) / max(len(frames), 1)
    identity = StreamIdentity()
    if rate_hz is not None:
        identity = _identity(numbers, repeated, rate_hz / configured_hz)
    return ReceivedFrames(
        len(frames),
        rate_hz,
        configured_hz,
        int(np.count_nonzero(~frames["tracking_valid"])),
        lost,
        *identity,
    )


def _identity(numbers: NDArray[np.int64], repeated: float, pace: float) -> StreamIdentity:
    """Return who spoke.

    Parameters
    ----------
    numbers
        Steps (N - 1,) from the number of a frame to that of the next in time.
    repeated
        Messages with the time of an earlier one, for each frame.
    pace
        Rate of the frames over the configured one.
    """
    if repeated > LARGEST_SHARE:
        return StreamIdentity(numbering="repeats")
    equal, back = float(np.mean(numbers == 0)), float(np.mean(numbers < 0))
    if equal > LARGEST_SHARE_OF_ONE:
        return StreamIdentity(numbering="stands still")
    if max(equal, back) <= FEW:
        return StreamIdentity()
    if pace > LARGEST_PACE:
        return StreamIdentity(publishers=round(pace))
    return StreamIdentity(numbering="starts again")
