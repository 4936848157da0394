"""Rows of the table of faults in which every stream is fresh and valid, and wrong.

A cable, a rigid body or a frame that is wrong is so from the first day; a tracking that fails does
so in the middle of a drive.
"""

from __future__ import annotations

from koopman_lab.config.fault_kinds import FaultKind
from koopman_lab.config.simulation import Fault
from offboard.bench.faults.bounds import (
    by_guard,
    by_guard_after_turning,
    by_tracking_timeout,
)
from offboard.bench.faults.scenario import Scenario, nothing
from offboard.bench.faults.stage import Activity
from offboard.bench.faults.strikes import Inject

_AXES, _HANDEDNESS = "check the axes of the cameras' frame", "handedness"
_FRAME: tuple[tuple[FaultKind, str, str], ...] = (
    ("heading_backwards", "rigid body's axis backwards", "the orientation of the rigid body"),
    ("x2_mirrored", "x2 mirrored", _AXES),
    ("frame_mirrored", "frame mirrored", _HANDEDNESS),
    ("axes_exchanged", "x1 and x2 exchanged", _AXES),
    ("frame_turned", "positions turned by 90 deg", _AXES),
    ("heading_turned", "headings turned by 90 deg", _AXES),
    ("heading_negated", "headings clockwise", _HANDEDNESS),
)
_STREAM: tuple[tuple[Fault, str, str], ...] = (
    (
        Fault(kind="camera_clock", jump_s=30.0),
        "camera clock 30 s ahead",
        "s ahead of this computer's clock",
    ),
    (Fault(kind="sequence_stuck"), "frames without numbers", "sequence does not count"),
    (Fault(kind="frames_doubled"), "each frame twice", "comes more than once"),
    (Fault(kind="camera_unit"), "poses in mm", "another unit than m"),
)
_WIRES: tuple[tuple[tuple[Fault, ...], str, str], ...] = (
    (
        (Fault(kind="motors_exchanged"), Fault(kind="encoders_exchanged")),
        "left and right wheel exchanged",
        "left and right wheel are exchanged",
    ),
    (
        (Fault(kind="motor_reversed"), Fault(kind="encoder_reversed")),
        "both wheels reversed",
        "reversed",
    ),
)
"""Wheels that obey their speed controllers, so that only the cameras can tell."""
_MERELY_BAD: tuple[tuple[FaultKind, str], ...] = (
    ("tracking_flipped", "now and then a frame flipped"),
    ("tracking_zero", "now and then a frame of zeros"),
    ("bodies_exchanged", "another body for 0.1 s now and then"),
    ("camera_slow", "half the camera rate"),
)
_ACTIVITIES: tuple[Activity, ...] = ("park", "calibrate")
_CALIBRATION_S = 45.0
"""Until the session has waited for long enough, or driven both ways."""


def _from_start(name: str, wrong: tuple[Fault, ...], message: str, activity: Activity) -> Scenario:
    return Scenario(
        f"{name} from the start",
        nothing,
        (),
        by_guard if activity == "park" else by_guard_after_turning,
        message,
        activity,
        _CALIBRATION_S if activity == "calibrate" else 4.0,
        wrong=wrong,
    )


CONTRADICTIONS: tuple[Scenario, ...] = (
    *(
        _from_start(name, (Fault(kind=kind),), message, activity)
        for activity in _ACTIVITIES
        for kind, name, message in _FRAME
    ),
    *(
        _from_start(name, (fault,), message, activity)
        for activity in _ACTIVITIES
        for fault, name, message in _STREAM
    ),
    *(
        _from_start(name, faults, message, activity)
        for activity in _ACTIVITIES
        for faults, name, message in _WIRES
    ),
    _from_start(
        "half the camera rate", (Fault(kind="camera_slow"),), "120 frames a second", "calibrate"
    ),
    *(
        Scenario(
            f"{name} in a drive",
            Inject(Fault(kind=kind)),
            ("DRIVING", "REST"),
            by_guard,
            "jumped by",
        )
        for kind, name, _ in _FRAME
        if kind not in ("x2_mirrored", "frame_mirrored", "heading_negated")
    ),
    Scenario(
        "tracking frozen in a drive",
        Inject(Fault(kind="tracking_frozen")),
        ("DRIVING", "REST"),
        by_guard,
        "tracking lost: the pose is frozen",
        watched_s=8.0,
    ),
    Scenario(
        "camera clock 30 s ahead in a drive",
        Inject(Fault(kind="camera_clock", jump_s=30.0)),
        ("DRIVING", "REST"),
        by_tracking_timeout,
        "s ahead of this computer's clock",
        watched_s=11.0,
    ),
    *(
        Scenario(f"{name} in a drive", Inject(Fault(kind=kind)), ("DRIVING",), watched_s=3.0)
        for kind, name in _MERELY_BAD
    ),
)
"""The table, after which `klab bench faults` and its test go."""
