"""The page of `klab up` outlives its lab: it says who died, and the robot can be started anew."""

import json
import os
import signal
import socket

import pytest
from klab import alive, klab, start_klab
from websockets.sync.client import connect

from offboard.terminal.exit_codes import ExitCode

LIMIT_S = 30.0
MOST_TRIES = 1200


def said_until(process, words):
    """Read what a command says until a line holds these words; return that line."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if words in line:
            return line
    return pytest.fail("".join(lines))


def shown_until(page, condition):
    """Read what a page is shown of the robot until it is as it should be."""
    for _ in range(MOST_TRIES):
        robot = json.loads(page.recv(LIMIT_S))["robots"].get("R1")
        if robot is not None and condition(robot):
            return robot
    return pytest.fail(f"never so: {robot and (robot['state'], robot['banners'])}")


def pid_of(robot, name):
    return next(row["pid"] for row in robot["processes"] if row["name"] == name)


def all_alive(robot):
    states = {row["name"]: row["state"] for row in robot["processes"]}
    return all(states.get(name) == "alive" for name in ("plant", "onboard", "logger"))


def test_the_page_says_who_died_and_the_robot_is_started_anew_beside_it(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    lab = start_klab("up", "--view", "--port", port, "--out", tmp_path / "up", cwd=tmp_path)
    said_until(lab, "page: ")
    with connect(f"ws://127.0.0.1:{port}/ws", max_size=None) as page:
        robot = shown_until(page, all_alive)
        viewer = pid_of(robot, "view")
        os.kill(pid_of(robot, "plant"), signal.SIGKILL)
        shown_until(page, lambda robot: any("plant died" in line for line in robot["banners"]))
        said_until(lab, "the page stays until Ctrl-C")
        robot = shown_until(page, lambda robot: robot["state"]["word"] == "gone")
        assert any("plant died (signal SIGKILL)" in line for line in robot["banners"])
        # Who asks elsewhere is told as well.
        assert "died" in klab("status").stdout
        again = start_klab("up", "--out", tmp_path / "again", cwd=tmp_path)
        said_until(again, "is up on")
        robot = shown_until(page, lambda robot: robot["state"]["word"] == "idle")
        assert not any("died" in line for line in robot["banners"])
        again.send_signal(signal.SIGINT)
        again.communicate(timeout=LIMIT_S)
        assert alive(viewer)
    lab.send_signal(signal.SIGINT)
    lab.communicate(timeout=LIMIT_S)
    assert lab.returncode == ExitCode.LAB_FAILURE
    assert not alive(viewer)
