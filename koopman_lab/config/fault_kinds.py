"""The kinds of faults that a simulated lab has on demand: what each does, and its details.

Their order is that of their numbers in ``fault_t`` and of their bits in ``plant_truth_t.faults``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

FaultKind = Literal[
    "occlusion",
    "encoder_stuck",
    "motor_stalled",
    "battery_low",
    "radio_cut",
    "burst_loss",
    "clock_jump",
    "encoder_reversed",
    "motor_reversed",
    "encoders_exchanged",
    "motors_exchanged",
    "heading_backwards",
    "x2_mirrored",
    "frame_mirrored",
    "axes_exchanged",
    "frame_turned",
    "heading_turned",
    "heading_negated",
    "tracking_frozen",
    "tracking_flipped",
    "tracking_zero",
    "bodies_exchanged",
    "camera_clock",
    "camera_slow",
    "sequence_stuck",
    "frames_doubled",
    "camera_unit",
]


class FaultDescription(NamedTuple):
    """One kind of fault.

    Attributes
    ----------
    says
        What it does, for a person.
    details
        What it has besides its duration, and the defaults.
    """

    says: str
    details: Mapping[str, Any] = {}


FAULT_KINDS: dict[FaultKind, FaultDescription] = {
    "occlusion": FaultDescription("the cameras do not see the robot"),
    "encoder_stuck": FaultDescription("an encoder's counter stands still", {"wheel": "both"}),
    "motor_stalled": FaultDescription("a motor is locked", {"wheel": "both"}),
    "battery_low": FaultDescription("the battery's voltage falls", {"battery_v": 6.0}),
    "radio_cut": FaultDescription("nothing crosses the radio"),
    "burst_loss": FaultDescription("the radio loses many messages", {"loss": 0.5}),
    "clock_jump": FaultDescription("the board's clock is ahead", {"jump_s": 10.0}),
    "encoder_reversed": FaultDescription("an encoder counts backwards", {"wheel": "both"}),
    "motor_reversed": FaultDescription("a motor turns backwards", {"wheel": "both"}),
    "encoders_exchanged": FaultDescription("left and right encoder are exchanged"),
    "motors_exchanged": FaultDescription("left and right motor are exchanged"),
    "heading_backwards": FaultDescription("theta + 180 deg: the body's axis points backwards"),
    "x2_mirrored": FaultDescription("-x2, theta as it is"),
    "frame_mirrored": FaultDescription("-x2 and -theta: a left-handed frame"),
    "axes_exchanged": FaultDescription("x1 and x2 exchanged, theta as it is"),
    "frame_turned": FaultDescription("positions turned by 90 deg, theta as it is"),
    "heading_turned": FaultDescription("theta + 90 deg"),
    "heading_negated": FaultDescription("-theta"),
    "tracking_frozen": FaultDescription("the last pose over and over, as if the robot were seen"),
    "tracking_flipped": FaultDescription("theta + 180 deg in 5 frames (20 ms) every 3 s"),
    "tracking_zero": FaultDescription("a pose of zeros in 2 frames (8 ms) every 5 s"),
    "bodies_exchanged": FaultDescription("the pose of another body for 0.1 s every 2 s"),
    "camera_clock": FaultDescription("time stamps of frames are ahead", {"jump_s": 10.0}),
    "camera_slow": FaultDescription("half of the frames are not taken"),
    "sequence_stuck": FaultDescription("the sequence number of frames stays as it was"),
    "frames_doubled": FaultDescription("each frame is sent twice, each time with the next number"),
    "camera_unit": FaultDescription("positions in mm instead of m"),
}
"""The table."""
