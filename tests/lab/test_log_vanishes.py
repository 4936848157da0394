"""A session whose log is taken away while the robot drives: it stops, and it is said why."""

import os

import pytest
from klab import MODEL, SMALL_AREA, start_klab
from witness import standing_robot

from koopman_lab.data.decode import SessionLog
from offboard.bench.faults.bounds import by_controller
from offboard.logger.node import KEEP_RATE_HZ
from offboard.terminal.exit_codes import ExitCode

BUSY_S = 0.25
"""What other processes on the machine may hold a message up, on top of the bound."""
QUICK = ("--set", "controller.horizon=20")
SESSIONS = {
    "calibrate": ("calibrate", "--segments", "1", *SMALL_AREA),
    "park": ("park", "--model", MODEL, *("--start", "-1.2", "0.2", "0"), *QUICK),
}


@pytest.fixture
def witness(bus_url, key_options):
    with standing_robot(bus_url, key_options) as witness:
        yield witness


@pytest.mark.parametrize(
    ("session", "harm", "words", "key_options"),
    [
        ("calibrate", lambda log: log.unlink(), "is gone", "no key"),
        ("park", lambda log: log.rename(log.with_name("elsewhere.lcm")), "is gone", "no key"),
        ("park", lambda log: os.truncate(log, 1000), "has 1000 bytes instead of", "key"),
    ],
    indirect=["key_options"],
)
def test_the_log_is_taken_away_while_the_robot_drives(
    session, harm, words, witness, key_options, tmp_path
):
    process = start_klab(*SESSIONS[session], *key_options, "--out", tmp_path / "run")
    try:
        witness.wait_until_fast(process)
        harm(tmp_path / "run" / "session.lcm")
        struck_us = witness.listener.now_us()
        code, said = witness.end_of(process)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert (code, said.count("klab: logger died")) == (ExitCode.LAB_FAILURE, 1)
    assert f"session.lcm: {words}" in " ".join(said.split())
    limit_s = by_controller(witness.config, 1.0 / KEEP_RATE_HZ)
    assert witness.moved_for_s(struck_us) <= limit_s + BUSY_S


def test_a_deleted_log_is_written_once_more(witness, key_options, tmp_path):
    """With a key or without."""
    process = start_klab(*SESSIONS["park"], *key_options, "--out", tmp_path / "run")
    try:
        witness.wait_until_fast(process)
        size = (tmp_path / "run" / "session.lcm").stat().st_size
        (tmp_path / "run" / "session.lcm").unlink()
        code, said = witness.end_of(process)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert code == ExitCode.LAB_FAILURE
    assert "what it held was written once more" in " ".join(said.split())
    assert (tmp_path / "run" / "session.lcm").stat().st_size >= size
    assert SessionLog(tmp_path / "run").channels["R1_MOCAP_POSE"].lost == 0
