"""Motors and encoders on the wrong wires, all 64 ways: the robot stops before it runs away.

The motor loop sees no more than how its encoders answer its duties. Where both are miswired alike
the wheels obey it, and only cameras can tell. In all other cases a wheel sooner or later does what
it was not told. Reversed wheels do so as soon as they move. Exchanged ones drive straight on as
they should, until the small differences of both motors have grown: so time counts from when a wheel
is first off its way, by 3 cm/s.
"""

from itertools import product

import pytest
from first_order_drives import with_real_gains
from miswired_bench import WIRINGS, as_the_board_sees, run_away

from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from onboard.plant.wiring import AS_INTENDED, Wiring

OBEYING = as_the_board_sees(AS_INTENDED, AS_INTENDED)
SHARES = {"straight": (1.0, 0.0), "turning": (0.0, 1.0), "curve": (1.0, 0.5), "slow": (-0.3, 0.15)}
CONFIGS = {
    (kind, preset): with_real_gains(kind)
    if preset == "real"
    else load_config(robot=kind, preset=preset)
    for kind in ("kinematic", "dynamic")
    for preset in ("lab", "harsh", "real")
}
MOST_OFF_S, MOST_ASTRAY_M = 0.3, 0.05
"""From when a wheel is off its way until the motors are off, and how far it is astray by then."""
REVERSED_LEFT, REVERSED_RIGHT = Wiring(left=-1), Wiring(right=-1)
CABLES = (REVERSED_LEFT, REVERSED_RIGHT, Wiring(left=-1, right=-1), Wiring(exchanged=True))
"""One cable mistaken for another."""
EVERYWHERE = pytest.mark.parametrize(("kind", "preset"), CONFIGS)
TOLD = pytest.mark.parametrize("share", SHARES.values(), ids=SHARES)


@TOLD
@EVERYWHERE
def test_whatever_the_wiring_a_robot_that_starts_does_not_run_away(kind, preset, share):
    config = CONFIGS[kind, preset]
    for motors, encoders in product(WIRINGS, WIRINGS):
        seen = as_the_board_sees(motors, encoders)
        run = run_away(config, motors, encoders, share, in_a_drive=False)
        assert (run.fault is None) is (seen == OBEYING), (motors, encoders)
        assert run.off_s <= MOST_OFF_S, (motors, encoders)
        assert run.astray_m <= MOST_ASTRAY_M, (motors, encoders)


@TOLD
@EVERYWHERE
def test_a_cable_that_changes_in_a_drive_stops_the_robot(kind, preset, share):
    for cable in CABLES:
        for motors, encoders in ((cable, AS_INTENDED), (AS_INTENDED, cable)):
            run = run_away(CONFIGS[kind, preset], motors, encoders, share, in_a_drive=True)
            assert run.fault, (motors, encoders)
            assert run.off_s <= MOST_OFF_S, (motors, encoders)
            assert run.astray_m <= MOST_ASTRAY_M, (motors, encoders)


@pytest.mark.parametrize(
    ("cable", "wheel"), [(REVERSED_LEFT, "LEFT"), (REVERSED_RIGHT, "RIGHT")], ids=["left", "right"]
)
@EVERYWHERE
def test_a_reversed_wheel_is_named_and_the_robot_stands_within_2_cm(kind, preset, cable, wheel):
    for motors, encoders in ((cable, AS_INTENDED), (AS_INTENDED, cable)):
        for share in (SHARES["straight"], SHARES["curve"]):
            run = run_away(CONFIGS[kind, preset], motors, encoders, share, in_a_drive=False)
            assert run.fault is Fault[f"{wheel}_WHEEL_CONTRARY"]
            assert run.off_s <= 0.12
            assert run.way_m + run.coast_m <= 0.02
