"""What the page starts: real commands, whose outcome it shows; who may start them."""

import json
import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest
from klab import alive, klab_ok
from viewer.page_server import LIMIT_S, serving
from websockets.sync.client import connect

MOST_TRIES = 1200


class Page:
    """A page's ear at the server, and what it was told of the runs."""

    def __init__(self, socket):
        self.socket = socket
        self.jobs = {"runs": [], "offers": {}}

    def until(self, condition):
        """Listen until what is said of the runs is as it should be."""
        for _ in range(MOST_TRIES):
            if condition(self.jobs):
                return self.jobs
            self.jobs = json.loads(self.socket.recv(LIMIT_S)).get("jobs", self.jobs)
        return pytest.fail(f"never so: {self.jobs['runs']}")

    def ask(self, **request):
        """Send a request and return the answer."""
        self.socket.send(json.dumps(request))
        for _ in range(MOST_TRIES):
            message = json.loads(self.socket.recv(LIMIT_S))
            self.jobs = message.get("jobs", self.jobs)
            if "said" in message:
                return message
        return pytest.fail("no answer")


@contextmanager
def opened(address, query=""):
    """Open the page at an address."""
    with connect(f"{address.replace('http', 'ws')}ws{query}", max_size=None) as socket:
        yield Page(socket)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Record a calibration once."""
    run = tmp_path_factory.mktemp("recorded") / "run"
    klab_ok("calibrate", "--lockstep", "--segments", "8", "--seed", "1", "--out", run)
    return run


@pytest.fixture
def folder(recorded, tmp_path):
    """Give a folder with a recorded calibration in its runs."""
    shutil.copytree(recorded, tmp_path / "runs" / "first-calibrate")
    return tmp_path


def stage(jobs, number):
    return next((run["stage"] for run in jobs["runs"] if run["number"] == number), None)


def children(pid):
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


def test_what_is_started_runs_as_a_command_and_its_outcome_and_folder_are_shown(folder):
    with serving(cwd=folder) as (_, address), opened(address) as page:
        jobs = page.until(lambda jobs: jobs["offers"].get("sessions"))
        assert [task["name"] for task in jobs["tasks"]] == [
            *("park", "calibrate", "train", "reference", "replay")
        ]
        assert jobs["offers"]["models"] == []
        (session, label, robot) = jobs["offers"]["sessions"][0]
        assert (label, robot) == ("first-calibrate (kinematic)", "kinematic")
        assert jobs["runs"][0]["state"]["word"] == "calibrated"
        refused = page.ask(do="start", task="train", values={"session": "/etc"})
        assert not refused["good"]
        assert "not offered" in refused["said"]
        answer = page.ask(do="start", task="train", values={"session": session})
        assert answer == {"robot": "", "good": True, "said": "Train: starting"}
        jobs = page.until(lambda jobs: stage(jobs, 1) == "ended")
        run = jobs["runs"][0]
        assert run["task"] == "train"
        assert run["state"]["word"] == "trained", run
        assert run["uses"] == {"Session": "first-calibrate (kinematic)"}
        assert (folder / "runs" / run["folder"] / "model.npz").exists()
        # What it has made can be chosen for what follows.
        jobs = page.until(lambda jobs: jobs["offers"]["models"])
        assert jobs["offers"]["models"][0][2] == "kinematic"
        # A command that refuses says why.
        refused = {"model": jobs["offers"]["models"][0][0], "robot": "R1", "goal": [99, 0, 0]}
        assert page.ask(do="start", task="park", values=refused)["good"]
        jobs = page.until(lambda jobs: stage(jobs, 2) == "ended")
        assert jobs["runs"][0]["state"]["word"] == "failed"
        assert "outside" in jobs["runs"][0]["state"]["detail"]


def test_what_runs_can_be_ended_and_what_waits_goes_with_a_stop(folder):
    with serving(cwd=folder) as (process, address), opened(address) as page:
        log = page.until(lambda jobs: jobs["offers"].get("logs"))["offers"]["logs"][0][0]
        slowly = {"do": "start", "task": "replay", "values": {"log": log, "speed": 0.1}}
        assert page.ask(**slowly)["said"] == "Replay: starting"
        page.until(lambda jobs: stage(jobs, 1) == "running")
        assert page.ask(**slowly)["said"] == "Replay: waits for its turn"
        assert page.ask(**slowly)["good"]
        assert page.ask(do="remove", number=3)["said"] == "Replay: removed from the queue"
        assert stage(page.until(lambda jobs: stage(jobs, 3) == "ended"), 2) == "waiting"
        # Of whatever robot: what waits must not begin behind somebody who has stopped one.
        page.ask(do="stop", robot="R9")
        jobs = page.until(lambda jobs: stage(jobs, 2) == "ended")
        assert {run["state"]["detail"] for run in jobs["runs"] if run["number"] in (2, 3)} == {
            *("STOP was pressed", "removed from the queue")
        }
        (child,) = children(process.pid)
        assert alive(child)
        assert page.ask(do="remove", number=1)["said"] == "Replay: asked to end"
        jobs = page.until(lambda jobs: stage(jobs, 1) == "ended")
        word = next(run["state"]["word"] for run in jobs["runs"] if run["number"] == 1)
        assert word == "ended by hand"
        assert not alive(child)
        assert "ended already" in page.ask(do="remove", number=1)["said"]
        # What still runs when the page ends is ended with it.
        assert page.ask(**slowly)["good"]
        page.until(lambda jobs: stage(jobs, 4) == "running")
        (child,) = children(process.pid)
    assert not alive(child)


def test_a_watcher_sees_all_of_it_and_starts_stops_and_moves_nothing(folder):
    with serving("--host", "0.0.0.0", cwd=folder) as (process, printed):
        said = process.stderr.readline()
        address = f"http://127.0.0.1:{printed.split(':')[2].split('/')[0]}/"
        token, watching = printed.split("token=")[1], said.split("token=")[1].split()[0]
        with (
            opened(address, f"?token={token}") as page,
            opened(address, f"?token={watching}") as other,
        ):
            log = page.until(lambda jobs: jobs["offers"].get("logs"))["offers"]["logs"][0][0]
            start = {"do": "start", "task": "replay", "values": {"log": log, "speed": 0.1}}
            goal = {"do": "goal", "robot": "R1", "x1_m": 0.0, "x2_m": 0.0, "theta_rad": 0.0}
            orders = [start, goal, {"do": "remove", "number": 1}]
            orders += [{"do": do, "robot": "R1"} for do in ("stop", "arm", "release")]
            for order in orders:
                answer = other.ask(**order)
                assert not answer["good"]
                assert "only watches" in answer["said"]
            assert page.ask(**start)["good"]
            # What others started, a watcher sees.
            other.until(lambda jobs: stage(jobs, 1) == "running")
            (child,) = children(process.pid)
            # The address of the page is a secret of the operator's, not of what it starts.
            environment = Path(f"/proc/{child}/environ").read_bytes()
            assert token.encode() not in environment
    assert not alive(child)
    assert [path.name for path in (folder / "runs").iterdir()] == ["first-calibrate"]
