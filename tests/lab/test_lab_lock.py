"""Of commands that start the same robot at the same moment, one does."""

import os
import subprocess
import sys

import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import LabStateError
from offboard.lab.lab_lock import lab_lock

HOLDER = """
import sys
from koopman_lab.config.load import load_config
from offboard.lab.lab_lock import lab_lock
with lab_lock(load_config(overrides=sys.argv[1:])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path))


def lab(*overrides):
    return load_config(overrides=["bus.url=udpm://239.255.76.67:1?ttl=0", *overrides])


def test_who_holds_a_robot_is_named_and_other_robots_and_buses_are_free():
    with lab_lock(lab()):
        with pytest.raises(LabStateError, match=rf"process {os.getpid()} .*klab down.*R1"):
            lab_lock(lab()).__enter__()
        with lab_lock(lab("robot.name=R2")), lab_lock(lab("bus.url=udpm://239.255.76.67:2?ttl=0")):
            pass
    with lab_lock(lab()):
        pass


def test_a_holder_that_is_killed_holds_nothing_any_more():
    url = lab().bus.url
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, f"bus.url={url}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(LabStateError, match=f"process {holder.pid} "):
            lab_lock(lab()).__enter__()
        holder.kill()
        holder.wait()
        with lab_lock(lab()):
            pass


def test_where_no_file_can_be_written_only_the_bus_is_heard(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "file"))
    with lab_lock(lab()), lab_lock(lab()):
        pass
