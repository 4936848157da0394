"""The worst of what is fresh and wrong over real UDP: a robot with wrong axes, cables or twins."""

import json
import re

import pytest
from klab import MODEL, SMALL_AREA, start_klab
from witness import Witness

from koopman_lab.bus.channels import INTERLOCK
from koopman_lab.units import US_PER_S
from offboard.bench.faults.bounds import by_guard_after_turning
from offboard.bench.faults.stage import is_at_rest, rolled_m
from offboard.desk.floor import excess_m
from offboard.terminal.exit_codes import ExitCode

BUSY_S = 0.5
"""What other processes on the machine may hold a message up, on top of the bound."""
FARTHEST_M = 0.6
"""Nobody drives farther on wrong axes: a second at the speed that is reached in it, and braking."""
PARK = ("park", "--model", MODEL, "--set", "controller.horizon=20")


@pytest.mark.parametrize(
    ("faults", "says"),
    [
        ("[{kind: heading_backwards, at_s: 0}]", "the orientation of the rigid body"),
        ("[{kind: frame_turned, at_s: 0}]", "check the axes of the cameras' frame"),
        ("[{kind: frame_mirrored, at_s: 0}]", "handedness"),
        ("[{kind: encoder_reversed, wheel: left, at_s: 0}]", "left wheel"),
    ],
)
def test_a_session_with_wrong_axes_or_cables_stops_at_once_and_says_what_to_check(
    bus_url, tmp_path, faults, says
):
    witness = Witness(bus_url)
    planned = ("--set", f"simulation.faults={faults}", *SMALL_AREA)
    session = start_klab("calibrate", "--segments", "1", *planned, "--out", tmp_path / "run")
    code, said = witness.end_of(session)
    assert code in (ExitCode.NO, ExitCode.MISUSE, ExitCode.LAB_FAILURE), said
    assert says in " ".join(said.split())
    moved = [s for s in witness.sights if abs(s.v_m_per_s) > 0.02 or abs(s.omega_rad_per_s) > 0.1]
    # In motion: a session on a busy machine may have to wait in between for what comes late.
    limit_s = by_guard_after_turning(witness.config) + BUSY_S
    assert len(moved) / witness.config.motor_loop.rate_hz <= limit_s
    assert rolled_m(moved) <= FARTHEST_M
    floor = witness.config.floor
    assert max(excess_m(floor, s.x1_m, s.x2_m) for s in witness.sights) == 0.0
    if code == 1:
        summary = json.loads((tmp_path / "run" / "summary.json").read_text())
        assert (summary["complete"], says in summary["reason"]) == (False, True)


def test_cameras_whose_clock_jumps_by_an_hour_stop_the_robot_and_are_named(
    bus_url, tmp_path, key_options
):
    witness = Witness(bus_url)
    session = start_klab(
        *(*PARK, "--start", "-1.2", "0.4", "0", *key_options),
        *("--set", "controller.pause_limit_s=2", "--out", tmp_path / "run"),
    )
    witness.wait_until_fast(session)
    witness.strike("camera_clock", key_options, jump_s=3600.0)
    code, said = witness.end_of(session)
    assert code == 1, said
    assert "the camera clock is 3600 s ahead of this computer's clock" in " ".join(said.split())
    limits = witness.config.motor_loop.limits
    blind_s = witness.config.controller.tracking_timeout_s + limits.v_m_per_s / limits.a_m_per_s2
    moving_us = [s.utime for s in witness.sights if not is_at_rest(s)]
    assert (max(moving_us) - witness.cut_us) / US_PER_S <= blind_s + BUSY_S
    assert is_at_rest(witness.sights[-1])


def test_a_robot_that_is_seen_elsewhere_than_placed_is_not_driven(bus_url, tmp_path):
    witness = Witness(bus_url)
    planned = ("--set", "simulation.faults=[{kind: axes_exchanged, at_s: 0}]")
    session = start_klab(*PARK, "--start", "-0.5", "0.3", "0", *planned, "--out", tmp_path / "run")
    code, said = witness.end_of(session)
    assert code == ExitCode.LAB_FAILURE
    assert re.search(r"they see it at x1 0\.3\d* m, x2 -0\.(5|49|51)", " ".join(said.split()))
    assert not [s for s in witness.sights if abs(s.v_m_per_s) > 0.02]


def test_nothing_starts_until_a_second_program_that_speaks_for_the_robot_is_gone(bus_url, tmp_path):
    witness, reasons = Witness(bus_url), []
    witness.listener.subscribe(INTERLOCK, lambda message: reasons.append(message.reason))
    twins = [start_klab("run", name, "--preset", "lab") for name in ("plant", "plant", "onboard")]
    try:
        witness.wait(lambda: {"plant", "onboard"} <= witness.pids.keys())
        session = start_klab(*PARK, "--out", tmp_path / "park")
        witness.wait(lambda: sum("R1_MOCAP_POSE: 2 publishers" in reason for reason in reasons) > 3)
        assert not [s for s in witness.sights if abs(s.v_m_per_s) > 0.02]
        twins[0].terminate()
        witness.wait_until_fast(session)
        session.terminate()
        witness.end_of(session)
    finally:
        for twin in twins:
            twin.terminate()
            twin.communicate(timeout=30)
