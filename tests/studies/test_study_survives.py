"""What kill -9 leaves of a study, and a cluster: in the end the same files, to the last byte."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from cluster import cluster
from joblib.externals.loky import get_reusable_executor
from test_parking_study import tiny

from koopman_lab.errors import LabStateError
from koopman_lab.studies import runner
from koopman_lab.studies.pools import Cluster, Processes
from koopman_lab.studies.runner import Study, run_study

RUNS = 12
LIMIT_S = 60.0
SAME = ("rows.csv", "table.csv", "distribution.csv", "study.json")


def study() -> Study:
    return Study("tiny", tiny(), RUNS)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    run_study(folder, study(), Processes(1))
    return files(folder)


def files(folder: Path) -> list[bytes]:
    return [(folder / name).read_bytes() for name in SAME]


def workers() -> list[int]:
    """Return the processes of the pool of this one."""
    found = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(FileNotFoundError):  # a thread, or a process, that has just ended
            for child in map(int, (task / "children").read_text().split()):
                command = Path(f"/proc/{child}/cmdline").read_bytes()
                found += [child] if b"popen_loky" in command else []
    return found


def kill_the_first() -> None:
    """Kill a worker as soon as there is one, long before it has anything to show."""
    end_s = time.monotonic() + LIMIT_S
    while time.monotonic() < end_s:
        for worker in workers()[:1]:
            os.kill(worker, signal.SIGKILL)
            return
        os.sched_yield()


def test_a_killed_worker_is_replaced(tmp_path, undisturbed):
    # Workers that other tests have left would idle through this one.
    get_reusable_executor().shutdown(wait=True, kill_workers=True)
    left = []
    killer = threading.Thread(target=kill_the_first)
    killer.start()
    run_study(tmp_path, study(), Processes(2), chunk=1, on_loss=left.append)
    killer.join()
    assert left == [3]
    assert json.loads((tmp_path / "summary.json").read_text())["pools_lost"] == 1
    assert files(tmp_path) == undisturbed


def test_what_kills_every_pool_ends_the_study(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "MOST_POOLS", 1)

    def kill_all(_done, _total, _rate):
        for worker in workers():
            os.kill(worker, signal.SIGKILL)

    with pytest.raises(LabStateError, match="--resume"):
        run_study(tmp_path, study(), Processes(2), chunk=1, on_progress=kill_all)


def test_two_commands_do_not_share_a_folder(tmp_path):
    def enter(_done, _total, _rate):
        run_study(tmp_path, study(), Processes(1), resume=True)

    with pytest.raises(LabStateError, match="at work"):
        run_study(tmp_path, study(), Processes(1), on_progress=enter)


KILLED = """
import os, signal, sys
from pathlib import Path
from test_study_survives import Processes, run_study, study
kill = lambda done, _total, _rate: done > 3 and os.kill(os.getpid(), signal.SIGKILL)
run_study(Path(sys.argv[1]), study(), Processes(2), chunk=1, on_progress=kill)
"""


def test_a_killed_command_goes_on(tmp_path, undisturbed):
    paths = os.pathsep.join(
        [str(Path(__file__).parent), str(Path(__file__).parents[1] / "support")]
    )
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": paths},
        timeout=LIMIT_S,
        check=False,
    )
    assert ended.returncode == -signal.SIGKILL
    rows = tmp_path / "rows.jsonl"
    kept = rows.read_bytes()
    assert 3 < len(kept.splitlines()) < 2 * RUNS
    run_study(tmp_path, study(), Processes(1), resume=True)
    assert rows.read_bytes().startswith(kept)
    assert len(rows.read_bytes().splitlines()) == 2 * RUNS
    assert files(tmp_path) == undisturbed


@pytest.fixture
def scheduler(tmp_path):
    with cluster(tmp_path, workers=2) as started:
        yield started


def test_a_cluster_brings_the_same_and_may_go(tmp_path, scheduler, undisturbed):
    process, address = scheduler
    run_study(tmp_path / "whole", study(), Cluster(address, workers=2), chunk=2)
    assert files(tmp_path / "whole") == undisturbed

    def kill(done, _total, _rate):
        if done:
            process.kill()

    with pytest.raises(LabStateError, match="--resume"):
        run_study(tmp_path / "half", study(), Cluster(address), chunk=1, on_progress=kill)
    run_study(tmp_path / "half", study(), Processes(1), resume=True)
    assert files(tmp_path / "half") == undisturbed
