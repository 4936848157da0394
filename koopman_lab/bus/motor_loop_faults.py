"""What the motor loop finds wrong: its numbers in ``onboard_status_t``, and what a person reads."""

from __future__ import annotations

from enum import IntEnum

from lcmtypes import onboard_status_t


class Fault(IntEnum):
    """What was found; the numbers are those of ``onboard_status_t``."""

    NO_FAULT = onboard_status_t.NO_FAULT
    BATTERY_LOW = onboard_status_t.BATTERY_LOW
    ENCODERS_SILENT = onboard_status_t.ENCODERS_SILENT
    LEFT_WHEEL_STUCK = onboard_status_t.LEFT_WHEEL_STUCK
    RIGHT_WHEEL_STUCK = onboard_status_t.RIGHT_WHEEL_STUCK
    LEFT_WHEEL_CONTRARY = onboard_status_t.LEFT_WHEEL_CONTRARY
    RIGHT_WHEEL_CONTRARY = onboard_status_t.RIGHT_WHEEL_CONTRARY
    LEFT_WHEEL_TOO_FAST = onboard_status_t.LEFT_WHEEL_TOO_FAST
    RIGHT_WHEEL_TOO_FAST = onboard_status_t.RIGHT_WHEEL_TOO_FAST
    LEFT_WHEEL_TOO_SLOW = onboard_status_t.LEFT_WHEEL_TOO_SLOW
    RIGHT_WHEEL_TOO_SLOW = onboard_status_t.RIGHT_WHEEL_TOO_SLOW
    STOP_NOT_KEPT = onboard_status_t.STOP_NOT_KEPT
    SECOND_LOOP = onboard_status_t.SECOND_LOOP


_CONTRARY = (
    "wheel does not obey its motor: check in this order the encoder's sign, the motor's leads, "
    "left for right, counts per turn"
)
_TOO_FAST = (
    "wheel runs away from its set-point: check in this order the motor's driver, counts per turn, "
    "gains"
)
_TOO_SLOW = (
    "wheel stays behind its set-point at full duty: check in this order what blocks it, the "
    "battery, counts per turn"
)
_TEXTS = {
    Fault.NO_FAULT: "no fault",
    Fault.BATTERY_LOW: "battery low",
    Fault.ENCODERS_SILENT: "encoders silent",
    Fault.LEFT_WHEEL_STUCK: "left wheel stuck",
    Fault.RIGHT_WHEEL_STUCK: "right wheel stuck",
    Fault.LEFT_WHEEL_CONTRARY: f"left {_CONTRARY}",
    Fault.RIGHT_WHEEL_CONTRARY: f"right {_CONTRARY}",
    Fault.LEFT_WHEEL_TOO_FAST: f"left {_TOO_FAST}",
    Fault.RIGHT_WHEEL_TOO_FAST: f"right {_TOO_FAST}",
    Fault.LEFT_WHEEL_TOO_SLOW: f"left {_TOO_SLOW}",
    Fault.RIGHT_WHEEL_TOO_SLOW: f"right {_TOO_SLOW}",
    Fault.STOP_NOT_KEPT: (
        "the board cannot keep a stop over a restart: its record cannot be read or written; what "
        "`klab run onboard` says names the file and why"
    ),
    Fault.SECOND_LOOP: (
        "a second onboard program speaks for this robot: end it, or give it another --robot-name"
    ),
}


def fault_text(number: int) -> str:
    """Return in words what a number of ``onboard_status_t`` means, also one of no version known."""
    return _TEXTS[Fault(number)] if number in _TEXTS else f"fault {number}"


def why_stopped(status: onboard_status_t) -> str | None:
    """Return what holds the robot until a person releases it, None if nothing does."""
    if status.state == status.ESTOP:
        return "emergency stop"
    return fault_text(status.fault) if status.state == status.FAULT else None
