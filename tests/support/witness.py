"""Sees the true robot of a lab in real time, and who is alive."""

import contextlib
import math
import os
import signal

import pytest
from klab import start_klab

from koopman_lab.bus.channels import FAULT, HEARTBEATS, PLANT_TRUTH
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import fault_message
from offboard.bench.faults.stage import TruthSample, is_at_rest

FAST_M_PER_S = 0.2
LIMIT_S = 120.0
"""A session has to drive, and later to end, within this time."""
WAIT_S = 0.05


class Witness:
    """Sees the true robot and who is alive."""

    def __init__(self, url):
        self.config = load_config(overrides=[f"bus.url={url}"])
        self.listener = Listener(self.config)
        self.sights = []
        self.cut_us = None
        self.pids = {}
        self.listener.subscribe(PLANT_TRUTH, self._see)
        for name, channel in HEARTBEATS.items():
            self.listener.subscribe(channel, lambda m, name=name: self.pids.update({name: m.pid}))

    def _see(self, t):
        self.sights.append(TruthSample.of(t))
        if t.faults and self.cut_us is None:
            self.cut_us = t.utime

    def wait(self, condition):
        end_us = self.listener.now_us() + LIMIT_S * 1e6
        while not condition():
            self.listener.spin(WAIT_S)
            assert self.listener.now_us() < end_us, "did not happen in time"

    def wait_until_fast(self, session):
        """Wait until a session drives the robot fast; if it never does, quote the session."""
        end_us = self.listener.now_us() + LIMIT_S * 1e6
        while not any(sight.v_m_per_s > FAST_M_PER_S for sight in self.sights[-10:]):
            self.listener.spin(WAIT_S)
            if session.poll() is not None or self.listener.now_us() > end_us:
                session.kill()
                pytest.fail(f"does not drive: {session.communicate()[0]}")

    def strike(self, kind, options=(), **details):
        """Let something go wrong with the robot for good, and wait until it has.

        A fault that is planned may strike before the session has begun, on a busy machine.
        """
        overrides = [f"bus.url={self.config.bus.url}", *(o for o in options if o != "--set")]
        speaker = Listener(load_config(overrides=overrides))
        fault = Fault(kind=kind, duration_s=math.inf, **details)

        def struck():
            speaker.publish(FAULT, fault_message(fault, speaker.now_us()))
            return self.cut_us is not None

        self.wait(struck)

    def kill(self, name):
        self.wait(lambda: name in self.pids)
        os.kill(self.pids[name], signal.SIGKILL)
        return self.listener.now_us()

    def end_of(self, process):
        """Wait for the end of a session; return its exit code and what it said."""
        self.wait(lambda: process.poll() is not None)
        said, _ = process.communicate()
        return process.returncode, said

    def moved_for_s(self, struck_us):
        """Return how long the robot went on moving, after watching it stand for a while."""
        seen = len(self.sights)
        self.wait(lambda: len(self.sights) >= seen + 50)
        return max((s.utime - struck_us) * 1e-6 for s in self.sights if not is_at_rest(s))


@contextlib.contextmanager
def standing_robot(url, options=()):
    """Run a robot that no session owns, which stays when a session has ended; give its witness."""
    witness = Witness(url)
    robot = [start_klab("run", name, "--preset", "lab", *options) for name in ("plant", "onboard")]
    try:
        witness.wait(lambda: {"plant", "onboard"} <= witness.pids.keys())
        yield witness
    finally:
        for process in robot:
            process.terminate()
            process.communicate(timeout=30)
