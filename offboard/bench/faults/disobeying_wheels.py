"""Rows of the table of faults in which a cable is wrong, and a wheel does not do as it is told.

The motor loop notices by itself: it needs no camera for that. Where motors and encoders are wrong
alike the wheels obey it; those rows are in :mod:`offboard.bench.faults.contradictions`.
"""

from __future__ import annotations

from collections.abc import Iterator

from koopman_lab.config.simulation import Fault
from offboard.bench.faults.bounds import by_disobeying_wheel
from offboard.bench.faults.scenario import Scenario, nothing
from offboard.bench.faults.strikes import Inject

_CABLES = (
    ("left encoder reversed", Fault(kind="encoder_reversed", wheel="left"), "left"),
    ("right encoder reversed", Fault(kind="encoder_reversed", wheel="right"), "right"),
    ("left motor reversed", Fault(kind="motor_reversed", wheel="left"), "left"),
    ("right motor reversed", Fault(kind="motor_reversed", wheel="right"), "right"),
    ("both encoders reversed", Fault(kind="encoder_reversed"), "left"),
    ("both motors reversed", Fault(kind="motor_reversed"), "left"),
    ("encoders exchanged", Fault(kind="encoders_exchanged"), ""),
    ("motors exchanged", Fault(kind="motors_exchanged"), ""),
)
"""What is wrong, and the wheel that is named: either, where both run away from each other."""


def _rows() -> Iterator[Scenario]:
    for name, fault, wheel in _CABLES:
        states = (f"FAULT {wheel.upper()}_WHEEL_CONTRARY" if wheel else "FAULT",)
        ends = by_disobeying_wheel, f"{wheel} wheel does not obey its motor".lstrip()
        yield Scenario(f"{name} from the start", nothing, states, *ends, wrong=(fault,))
        yield Scenario(f"{name} in a drive", Inject(fault), states, *ends)
        if fault.wheel in ("left", "right"):
            yield Scenario(
                *(f"{name} in a drive", Inject(fault), states, *ends, "calibrate"), watched_s=5.0
            )


DISOBEYING_WHEELS = tuple(_rows())
"""After it `klab bench faults` and its test go."""
