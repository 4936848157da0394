"""What lies in the folder of runs, as the page shows it."""

import json
import os
import shutil

import pytest
from klab import MODEL, REFERENCE

from offboard.lab.job_outcome import job_outcome
from offboard.lab.run_history import MOST_RUNS, RunHistory
from offboard.lab.run_outcome import outcome_of

PARKED = {
    **{"what": "park", "parked": True, "reason": "parked", "final_pose": [0.003, 0.004, 0.01]},
    **{"duration_s": 7.25, "robot": "kinematic", "seed": 3, "model": "/m.npz", "cost": "me"},
}
CALIBRATED = {
    **{"what": "calibrate", "complete": True, "reason": "", "segments": 6, "segments_wanted": 6},
    **{"verdict": {"level": "weak"}, "robot": "kinematic", "seed": 1},
}


def left(folder, summary=None, log=True, at_s=1000.0):
    folder.mkdir(parents=True)
    if log:
        shutil.copy(REFERENCE / "park.lcm", folder / "session.lcm")
    if summary is not None:
        (folder / "summary.json").write_text(json.dumps(summary))
        os.utime(folder / "summary.json", (at_s, at_s))
    return folder


@pytest.mark.parametrize(
    ("summary", "expected"),
    [
        (PARKED, ("parked", "good", "5.0 mm and 0.6° from the goal, after 7.2 s")),
        (
            PARKED | {"parked": False, "reason": "time limit", "final_pose": None},
            ("not parked", "warn", "time limit, after 7.2 s"),
        ),
        (CALIBRATED, ("calibrated", "good", "6 of 6 segments, data weak")),
        (
            CALIBRATED | {"complete": False, "reason": "lost", "segments": 2},
            ("not calibrated", "warn", "lost, 2 of 6 segments, data weak"),
        ),
        ({"what": "reference", "complete": True}, ("runs recorded", "good", "? of ? runs")),
        ({"what": "demo", "passed": False}, ("not parked", "warn", "")),
        ({}, ("done", "idle", "")),
        ({"what": ["park"]}, ("done", "idle", "")),
        ({"what": "park", "final_pose": [None, "x", 1]}, ("not parked", "warn", "")),
    ],
)
def test_an_outcome_is_read_from_the_summary(summary, expected):
    assert outcome_of(summary) == expected


def test_runs_and_models_are_found_the_newest_first(tmp_path):
    demo = tmp_path / "runs" / "demo"
    left(demo / "calibration", CALIBRATED, at_s=1000.0)
    left(demo / "park", PARKED, at_s=2000.0)
    begun = left(tmp_path / "runs" / "20260101-000000-park")
    (begun / "processes").mkdir()
    (begun / "processes" / "controller.log").touch()
    os.utime(begun / "session.lcm", (3000.0, 3000.0))
    os.utime(left(tmp_path / "runs" / "up") / "session.lcm", (4000.0, 4000.0))
    left(demo / "park" / "processes" / "x", PARKED)
    shutil.copy(MODEL, demo / "model.npz")
    (demo / "data.npz").write_bytes(b"none")
    (demo / "park" / "summary.json").with_name("other.json").write_text("{}")
    runs, models = RunHistory(tmp_path / "runs").look()
    assert [(r.folder.name, r.what, r.outcome.word, r.log) for r in runs] == [
        ("up", "log", "recorded", True),
        ("20260101-000000-park", "park", "not finished", True),
        ("park", "park", "parked", True),
        ("calibration", "calibrate", "calibrated", True),
    ]
    assert runs[2].uses == {"model": "/m.npz", "cost": "me", "seed": "3"}
    assert [(m.file.name, m.robot, m.name) for m in models] == [("model.npz", "kinematic", "D5t")]


def test_nothing_is_there_yet(tmp_path):
    assert RunHistory(tmp_path / "runs").look() == ([], [])


def test_a_damaged_summary_hides_no_other_run_and_what_changes_is_read_again(tmp_path):
    folder = left(tmp_path / "a", PARKED)
    other = left(tmp_path / "b", PARKED)
    (other / "summary.json").write_text('{"what": ')
    history = RunHistory(tmp_path)
    words = {run.folder.name: run.outcome.word for run in history.look()[0]}
    assert words == {"a": "parked", "b": "summary damaged"}
    (folder / "summary.json").write_text(json.dumps(CALIBRATED))
    shutil.rmtree(other)
    words = {run.folder.name: run.outcome.word for run in history.look()[0]}
    assert words == {"a": "calibrated"}


def test_only_so_many_runs_are_shown(tmp_path):
    for k in range(MOST_RUNS + 3):
        left(tmp_path / str(k), PARKED, log=False, at_s=1000.0 + k)
    runs, _ = RunHistory(tmp_path).look()
    assert [run.folder.name for run in runs] == [str(k + 3) for k in reversed(range(MOST_RUNS))]


@pytest.mark.parametrize(
    ("code", "said", "stopped", "word", "detail"),
    [
        (0, [], False, "done", ""),
        (2, ["x", "klab: R1_X: silent", "more"], False, "failed", "R1_X: silent\nmore"),
        (2, ["klab: plant died (signal SIGKILL); f ends with:"], False, "process died", "plant"),
        (-9, ["x"], False, "killed", "signal SIGKILL"),
        (1, ["a", "b", "c"], False, "failed", "exit code 1: b c"),
        (130, ["interrupted"], True, "ended by hand", ""),
    ],
)
def test_a_command_that_left_nothing_is_judged_by_what_it_said(code, said, stopped, word, detail):
    state = job_outcome(code, said, None, stopped=stopped)
    assert state.word == word
    assert state.detail.startswith(detail)


def test_a_command_is_judged_by_what_it_left_whatever_its_exit_code(tmp_path):
    folder = left(tmp_path / "park", PARKED | {"parked": False, "reason": "time limit"})
    assert job_outcome(1, [], folder, stopped=False).word == "not parked"
    trained = tmp_path / "train"
    trained.mkdir()
    shutil.copy(MODEL, trained / "model.npz")
    state = job_outcome(0, [], trained, stopped=False)
    assert state.word == "trained"
    assert "D5t, kinematic robot" in state.detail
    kept = left(tmp_path / "calibrate")
    assert job_outcome(130, [], kept, stopped=True) == (
        *("ended by hand", "idle", "what was recorded is kept"),
    )
