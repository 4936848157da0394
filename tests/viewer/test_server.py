"""The page's server as it runs: its own process, real websockets, a real bus."""

import json
import re
import time
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager
from socket import create_connection

import pytest
from viewer.page_server import LIMIT_S, URL, serving
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import lcmtypes
from koopman_lab.bus.channels import (
    ESTOP,
    GOAL,
    MOCAP_POSE,
    MPC_STATE,
    ONBOARD_STATUS,
    REPLAY_CONTROL,
    REPLAY_STATE,
)
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config

MOST_TRIES = 300
WAIT_S = 0.02


class Bench:
    """A robot's voice on the bus, and a page's ear at the server."""

    def __init__(self, process, address, name="R1"):
        self.process, self.address, self.name = process, address, name
        self.stops, self.goals = [], []
        self.bus = Listener(load_config(overrides=[URL, f"robot.name={name}"]))
        self.bus.subscribe(ESTOP, self.stops.append)
        self.bus.subscribe(GOAL, self.goals.append)
        self.state = lcmtypes.onboard_status_t.REST
        self.late_us = 0

    def speak(self):
        """Say once what a robot that is being parked says."""
        status, pose, step = (c.type() for c in (ONBOARD_STATUS, MOCAP_POSE, MPC_STATE))
        status.state, pose.tracking_valid, step.state = self.state, True, step.DRIVING
        for channel, message in ((ONBOARD_STATUS, status), (MOCAP_POSE, pose), (MPC_STATE, step)):
            message.utime = self.bus.now_us() - self.late_us
            self.bus.publish(channel, message)
        self.bus.spin(WAIT_S)

    @contextmanager
    def page(self):
        with connect(self.address.replace("http", "ws") + "ws", max_size=None) as socket:
            yield socket

    def snapshot(self, socket):
        while "robots" not in (message := json.loads(socket.recv(LIMIT_S))):
            pass
        return message

    def read_on(self, socket):
        for _ in range(MOST_TRIES):
            socket.recv(LIMIT_S)

    def until(self, socket, condition):
        """Speak and listen until a snapshot is as wanted."""
        for _ in range(MOST_TRIES):
            self.speak()
            robot = self.snapshot(socket)["robots"].get(self.name)
            if robot is not None and condition(robot):
                return robot
        return pytest.fail("the page never showed it")

    def ask(self, socket, **request):
        """Send a request and return the answer."""
        socket.send(json.dumps({"robot": self.name} | request))
        for _ in range(MOST_TRIES):
            self.speak()
            if self.stops:
                kind = lcmtypes.onboard_status_t
                self.state = kind.ESTOP if self.stops[-1].engaged else kind.REST
            message = json.loads(socket.recv(LIMIT_S))
            if "said" in message:
                return message
        return pytest.fail("no answer")


@pytest.fixture(scope="module")
def served():
    with serving() as found:
        yield found


@pytest.fixture
def bench(served):
    return Bench(*served)


def test_the_page_is_served_whole_and_nobody_elses_page_may_use_it(bench):
    with urllib.request.urlopen(bench.address) as answer:
        page = answer.read().decode()
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    # Nothing comes from elsewhere: it works without internet.
    parts = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert len(parts) >= 4
    for part in parts:
        with urllib.request.urlopen(bench.address + part) as answer:
            assert answer.read()
            assert answer.headers["Cache-Control"] == "no-cache"
    strange = urllib.request.Request(bench.address, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(strange)
    with pytest.raises(InvalidStatus, match="403"):
        connect(bench.address.replace("http", "ws") + "ws", origin="http://evil.example")
    assert "refused 127.0.0.1: host 'evil.example'" in bench.process.stderr.readline()
    assert "refused 127.0.0.1: origin 'http://evil.example'" in bench.process.stderr.readline()


def test_from_outside_only_the_printed_token_opens_page_and_socket():
    with serving("--host", "0.0.0.0") as (process, printed):
        address, token = re.fullmatch(r"http://[^:]+(:\d+/)\?token=(\S+)", printed).groups()
        watching = re.search(r"to watch only: \S+token=(\S+)", process.stderr.readline()).group(1)
        for wrong in ("", "?token=", f"?token={token}x", f"?token={token.swapcase()}"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(f"http://127.0.0.1{address}{wrong}")
            with pytest.raises(InvalidStatus, match="403"):
                connect(f"ws://127.0.0.1{address}ws{wrong}")
        counted = 0
        while counted < 8:
            said = process.stderr.readline()
            assert said.startswith(
                "refused 127.0.0.1: the address lacks the token that `klab view`"
            )
            assert token not in said
            more = re.search(r"\(the newest of (\d+)\)", said)
            counted += int(more.group(1)) if more else 1
        assert counted == 8
        with urllib.request.urlopen(f"http://127.0.0.1{address}?token={token}") as answer:
            assert "klab view" in answer.read().decode()
        for known, may_order in ((token, True), (watching, False)):
            with connect(f"ws://127.0.0.1{address}ws?token={known}", max_size=None) as socket:
                assert json.loads(socket.recv(LIMIT_S))["may_order"] is may_order


@pytest.mark.parametrize("frame", ["garbage", b"bytes", "x" * 100_000, '{"do": "goal"}'])
def test_a_client_that_sends_nonsense_is_put_out_and_nothing_moves(bench, frame):
    with bench.page() as other, bench.page() as socket:
        bench.until(other, lambda robot: robot["steerable"])
        socket.send(frame)
        with pytest.raises(ConnectionClosed):
            bench.read_on(socket)
        bench.until(other, lambda robot: robot["steerable"])
    assert not bench.stops
    assert not bench.goals


def test_whoever_is_turned_away_is_in_the_servers_words_with_its_address():
    with serving() as (process, address), ExitStack() as clients:
        bench, ws = Bench(process, address), address.replace("http", "ws") + "ws"
        port = int(re.search(r":(\d+)/", address).group(1))
        with bench.page() as socket:
            socket.send("x" * 5000)
            with pytest.raises(ConnectionClosed, match="1009"):
                bench.read_on(socket)
        assert process.stderr.readline() == "refused 127.0.0.1: a frame of more than 4096 bytes\n"
        with create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(b"\xff\xfe no HTTP\r\n\r\n")
            assert b" 400 " in raw.recv(100)
        assert "refused unknown client: Invalid HTTP" in process.stderr.readline()
        for _ in range(32):
            clients.enter_context(connect(ws, max_queue=None, max_size=None))
        with connect(ws) as late, pytest.raises(ConnectionClosed, match="1013"):
            late.recv(LIMIT_S)
        said = process.stderr.readline()
        assert said == "refused 127.0.0.1: 32 pages are open, the most there may be\n"
        shake = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: no\r\n\r\n"
        with create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\n{shake}".encode())
            assert b" 400 " in raw.recv(100)
        said = process.stderr.readline()
        assert said == "refused 127.0.0.1: a bad request for a websocket\n"


def test_stop_goes_out_until_it_is_obeyed_and_release_takes_two_steps(bench):
    with bench.page() as socket:
        bench.until(socket, lambda robot: robot["steerable"])
        stopped = bench.ask(socket, do="stop")
        assert stopped == {"robot": "R1", "good": True, "said": "R1: STOP confirmed"}
        bench.until(socket, lambda robot: robot["stopped"])
        refused = bench.ask(socket, do="release")
        assert (refused["good"], refused["said"]) == (
            False,
            "R1: releasing takes two steps; begin again",
        )
        assert bench.ask(socket, do="arm")["good"]
        assert "double click" in bench.ask(socket, do="release")["said"]
        for _ in range(MOST_TRIES):
            bench.speak()
            released = bench.ask(socket, do="release")
            if released["good"]:
                break
            assert "double click" in released["said"]
        assert released == {"robot": "R1", "good": True, "said": "R1: release confirmed"}
        bench.until(socket, lambda robot: not robot["stopped"])


def test_a_goal_off_the_floor_is_refused_and_a_good_one_is_sent(bench):
    with bench.page() as socket:
        bench.until(socket, lambda robot: robot["goal"] is not None)
        goal = {"do": "goal", "x1_m": 99.0, "x2_m": 0.0, "theta_rad": 0.0}
        assert "outside" in bench.ask(socket, **goal)["said"]
        assert not bench.goals
        socket.send(json.dumps(goal | {"robot": "R1", "x1_m": 0.5}))
        for _ in range(MOST_TRIES):
            bench.speak()
            if bench.goals:
                break
        assert bench.goals[0].goal_x1_m == 0.5


def test_who_saw_an_old_picture_can_stop_and_nothing_else(bench):
    goal = {"x1_m": -0.25, "x2_m": 0.0, "theta_rad": 0.0}
    with bench.page() as socket:
        bench.until(socket, lambda robot: robot["goal"] is not None)
        old = {"seen_us": time.time_ns() // 1000 - 10_000_000}
        for do in ("goal", "arm", "release"):
            answer = bench.ask(socket, do=do, **goal, **old)
            assert not answer["good"]
            assert "10 s old" in answer["said"]
            # Nobody has seen what is still to come.
            ahead = {"seen_us": time.time_ns() // 1000 + 10_000_000}
            assert "-10 s old" in bench.ask(socket, do=do, **goal, **ahead)["said"]
        assert bench.ask(socket, do="stop", **old)["good"]
    assert all(sent.goal_x1_m != goal["x1_m"] for sent in bench.goals)


def test_a_replay_cannot_be_steered(served):
    bench = Bench(*served, name="R2")
    bench.late_us = 3600_000_000
    with bench.page() as socket:
        robot = bench.until(socket, lambda robot: robot["replay"])
        assert not robot["steerable"]
        for do in ("arm", "goal", "release"):
            answer = bench.ask(socket, do=do, x1_m=0.0, x2_m=0.0, theta_rad=0.0)
            assert "replay" in answer["said"]
    assert not bench.stops


def test_a_replay_is_steered_from_the_page(served):
    """What is asked for goes out until the replay says that it was obeyed."""
    bench, asked = Bench(*served, name="R4"), []
    bench.late_us, state = 3600_000_000, REPLAY_STATE.type()
    bench.bus.subscribe(REPLAY_CONTROL, asked.append)
    with bench.page() as socket:
        bench.until(socket, lambda robot: robot["replay"])
        answer = bench.ask(socket, do="replay", action="pause")
        assert "no replay can be steered" in answer["said"]

        def until(condition):
            for _ in range(MOST_TRIES):
                state.utime, state.end_s = bench.bus.now_us(), 30.0
                bench.bus.publish(REPLAY_STATE, state)
                bench.speak()
                robot = bench.snapshot(socket)["robots"]["R4"]
                if condition(robot):
                    return robot["replay_progress"]
            return pytest.fail("never happened")

        assert until(lambda robot: robot["replay_progress"])["end_s"] == 30.0
        request = {"do": "replay", "robot": "R4", "action": "seek", "value": 12.5}
        socket.send(json.dumps(request))
        until(lambda _: len(asked) > 2)  # again, as nobody obeys
        assert {(c.action, c.value, c.number) for c in asked} == {
            (asked[0].SEEK, 12.5, asked[0].number)
        }
        state.control, state.position_s = asked[0].number, 12.5
        until(lambda robot: robot["replay_progress"]["position_s"] == 12.5)
        count = len(asked)
        until(lambda _: True)
        until(lambda _: True)
        assert len(asked) <= count + 1


def test_a_robot_that_looks_like_a_replay_hears_the_stop_all_the_same(served):
    """Its clock is right, and that of the page is wrong: it obeys, and the page says so."""
    bench = Bench(*served, name="R3")
    bench.late_us = 10_000_000
    with bench.page() as socket:
        bench.until(socket, lambda robot: robot["replay"])
        answers = [bench.ask(socket, do="stop")["said"]]
        assert "STOP was sent all the same" in answers[0]
        while "STOP confirmed" not in answers[-1]:
            bench.speak()
            answers.append(json.loads(socket.recv(LIMIT_S)).get("said", ""))
        assert len(answers) < MOST_TRIES
    assert all(stop.engaged for stop in bench.stops)
