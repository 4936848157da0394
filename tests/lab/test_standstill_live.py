"""Real processes over real UDP that are stopped for a while and then go on."""

import json
import os
import signal

import pytest
from klab import MODEL, SMALL_AREA, start_klab
from witness import Witness

from offboard.bench.faults.stage import is_at_rest

STILL_S = 3.0
SETTLED = 60
"""Sights of the standing robot, and as many after the session's end."""
STILL_M = 2e-3
SESSIONS = {
    "controller": ("park", "--model", MODEL, "--start", "-1.2", "0.4", "0"),
    "sampler": ("calibrate", "--segments", "6", *SMALL_AREA),
    "reference": ("reference", "--shape", "square", "--runs", "3"),
}


def reason_of(folder):
    return json.loads((folder / "summary.json").read_text())["reason"]


@pytest.mark.parametrize(
    ("name", "others", "key_options"),
    [
        ("controller", (), "no key"),
        ("controller", (), "key"),
        ("sampler", (), "no key"),
        ("reference", (), "no key"),
        ("controller", ("onboard", "plant"), "no key"),
    ],
    ids=["controller", "controller with a key", "sampler", "reference", "all"],
    indirect=["key_options"],
)
def test_who_stood_still_says_so_and_does_not_drive_on(
    bus_url, tmp_path, name, others, key_options
):
    witness = Witness(bus_url)
    session = start_klab(*SESSIONS[name], *key_options, "--out", tmp_path / "run")
    witness.wait_until_fast(session)
    witness.wait(lambda: {name, *others} <= witness.pids.keys())
    stopped = [witness.pids[other] for other in (name, *others)]
    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    began_us = witness.listener.now_us()
    witness.wait(lambda: witness.listener.now_us() - began_us > STILL_S * 1e6)
    if not others:
        assert all(map(is_at_rest, witness.sights[-SETTLED:])), "the watchdog has stopped it"
    at = len(witness.sights)
    for pid in reversed(stopped):
        os.kill(pid, signal.SIGCONT)
    code, said = witness.end_of(session)
    assert code == 1, said
    assert "stood still for" in reason_of(tmp_path / "run")
    if not others:
        after = witness.sights[at:]
        for axis in ("x1_m", "x2_m"):
            places = [getattr(sight, axis) for sight in after]
            assert max(places) - min(places) < STILL_M
