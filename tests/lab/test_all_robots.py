"""Orders to every robot on a bus, over real UDP."""

import subprocess
import sys

import pytest
from klab import alive, klab, start_klab
from real_bus import Ear

from koopman_lab.bus.channels import ONBOARD_STATUS
from offboard.terminal.exit_codes import ExitCode

STATUS = ONBOARD_STATUS.type


@pytest.fixture
def robots(bus_url, tmp_path, monkeypatch):
    """Bring two robots up on one bus; give by name their command and who hears them."""
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    started = {}
    try:
        for name in ("R1", "R2"):
            ear = Ear(bus_url, name)
            started[name] = start_klab("up", "--robot-name", name, "--out", tmp_path / name), ear
        for _, ear in started.values():
            ear.wait_for("plant", "onboard", "logger")
        yield started
    finally:
        for process, _ in started.values():
            process.terminate()
            process.communicate(timeout=60)


def klab_with_clock(ahead_s, *arguments):
    """Run a command on a computer whose clock is set wrong."""
    ahead = (
        "import sys, time; right = time.time_ns; "
        f"time.time_ns = lambda: right() + {ahead_s} * 10**9; "
        "from offboard.cli.main import main; main()"
    )
    command = [sys.executable, "-c", ahead, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def wait_for_states(robots, *states):
    for _, ear in robots.values():
        ear.status = None
        ear.wait(lambda ear=ear: ear.status is not None and ear.status.state in states)


def test_all_are_stopped_released_and_brought_down_by_name(robots, bus_url, tmp_path):
    stopped = klab("estop", "--all")
    assert stopped.returncode == 0, stopped.stderr
    assert sorted(stopped.stderr.splitlines()) == [
        "R1: stopped", "R2: stopped", "`klab estop --all --release` releases them",
    ]  # fmt: skip
    wait_for_states(robots, STATUS.ESTOP)
    # A third one speaks, but nobody there can confirm.
    deaf = start_klab("run", "logger", "--robot-name", "R3", "--out", tmp_path / "R3")
    try:
        Ear(bus_url, "R3").wait_for("logger")
        released = klab("estop", "--all", "--release")
        assert released.returncode == ExitCode.LAB_FAILURE
        assert "R1: released\n" in released.stderr
        assert "R2: released\n" in released.stderr
        assert "klab: R3 is silent: the message was sent 100 times" in released.stderr
        wait_for_states(robots, STATUS.REST)
        one = klab("down", "--robot-name", "R1")
        assert (one.returncode, one.stderr) == (0, "R1 is down\n")
        down = klab("down", "--all")
        assert down.returncode == 1
        assert "R2 is down\n" in down.stderr
        assert f"R3 is not down; still there: logger (process {deaf.pid}: " in down.stderr
        assert deaf.poll() is None
    finally:
        deaf.terminate()
        deaf.communicate(timeout=60)
    for process, ear in robots.values():
        process.communicate(timeout=60)
        assert process.returncode == 130
        assert not any(map(alive, ear.pids.values()))


@pytest.mark.parametrize("ahead_s", [-3600, 10])
def test_a_desk_whose_clock_is_wrong_stops_and_releases(robots, ahead_s):
    """To it all that is said looks like a log; the robots know which stop is meant."""
    for arguments, said in (
        (("--all",), {"R1: stopped", "R2: stopped", "`klab estop --all --release` releases them"}),
        (("--all", "--release"), {"R1: released", "R2: released"}),
        (("--robot-name", "R2"), {"stopped; `klab estop --release` releases it"}),
        (("--robot-name", "R2", "--release"), {"released"}),
    ):
        done = klab_with_clock(ahead_s, "estop", *arguments)
        assert done.returncode == 0, done.stderr
        assert set(done.stderr.splitlines()) == said
    wait_for_states(robots, STATUS.REST)


def test_two_labs_go_down_at_the_same_time(robots):
    down = klab("down", "--all")
    assert (down.returncode, down.stderr) == (0, "R1 is down\nR2 is down\n")
    assert {process.wait(timeout=60) for process, _ in robots.values()} == {130}


def test_where_nobody_is_heard_the_configured_robot_is_stopped_and_named():
    done = klab("estop", "--all", "--limit-s", "2", "--set", "robot.name=R7")
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "no robot was heard, and R7 is silent: the message was sent 100 times" in done.stderr
    down = klab("down", "--all")
    assert down.returncode == ExitCode.LAB_FAILURE
    assert "no `klab up`, `calibrate` or `park` of this machine runs on" in down.stderr


@pytest.mark.parametrize("command", ["estop", "down"])
def test_one_and_all_is_a_mistake(command):
    done = klab(command, "--all", "--robot-name", "R2")
    assert done.returncode == 2
    assert "--all and --robot-name R2: all robots or one; drop one" in done.stderr
