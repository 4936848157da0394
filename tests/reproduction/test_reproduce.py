"""`klab reproduce`: its steps, and the runner that keeps what is done."""

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys

import pytest
import typer
from klab import REFERENCE, klab

from koopman_lab.errors import LabStateError, UsageError
from koopman_lab.files import sha256
from offboard.cli.main import app
from offboard.reproduction import step_runner as runner
from offboard.reproduction.paper.claim import judge
from offboard.reproduction.paper.claims import CLAIMS
from offboard.reproduction.paper.pictures import GRIDS, PICTURES, STUDIES
from offboard.reproduction.paper.settings import SETTINGS
from offboard.reproduction.paper.step_results import StepResults
from offboard.reproduction.step_runner import MARKER, Step, finished, run, with_needs
from offboard.reproduction.steps import FULL, QUICK, judged_steps, steps

PARK = REFERENCE / "park.lcm"
SMALL = ("--set", "controller.horizon=5", "--duration")
FIRST = Step("first", ("simulate", *SMALL, "1", "--out", "first"))


def simulation(duration_s):
    asked = ("--config", "first/config.yaml", *SMALL, str(duration_s))
    return Step("path", ("simulate", *asked, "--out", "path"))


def nothing(_line):
    """Say nothing."""


@pytest.mark.parametrize("size", [FULL, QUICK])
def test_each_step_is_a_command_line_that_needs_only_steps_before_it(size):
    listed = steps(size, seed=1)
    names = [step.name for step in listed]
    klab_command = typer.main.get_command(app)
    assert len(set(names)) == len(names)
    for number, step in enumerate(listed):
        assert step.needs(listed) <= set(names[:number])
        command, rest = klab_command, list(step.arguments)
        while hasattr(command, "commands"):
            command = command.commands[rest.pop(0)]
        # What the runner may add is parsed, too.
        rest += ["--resume"] if step.resumable else []
        rest += ["--workers", "2"] if step.parallel else []
        command.make_context("klab", rest)
        # Nothing lands outside of the step's own folder.
        assert step.arguments[step.arguments.index("--out") + 1].split("/")[0] == step.name


def test_a_step_comes_with_all_that_it_needs():
    listed = steps(QUICK, seed=1)
    chosen = with_needs(listed, ["kinematic-lab"])
    assert [step.name for step in chosen] == [
        *("kinematic-session", "kinematic-model", "kinematic-lab"),
    ]
    # In the order of all, however they are asked for.
    both = with_needs(listed, ["kinematic-lab", "kinematic-session", "needed"])
    assert [step.name for step in both] == [
        *("kinematic-session", "kinematic-model", "kinematic-lab", "dynamic-session", "needed"),
    ]
    assert with_needs(listed, [step.name for step in listed]) == listed
    with pytest.raises(UsageError, match=r"no-step: no such step; there are kinematic-session"):
        with_needs(listed, ["needed", "no-step"])


def test_claims_and_figures_are_of_steps_that_there_are(tmp_path):
    listed, first = steps(QUICK, seed=1), judged_steps(QUICK, seed=1)
    assert listed[: len(first)] == first
    names, judged = {step.name for step in listed}, {step.name for step in first}
    found = StepResults(tmp_path)
    for claim in (*CLAIMS, *SETTINGS):
        assert set(judge(claim, found).steps) <= judged
    assert {picture.step for picture in PICTURES} <= names
    assert {*STUDIES, *GRIDS} <= names


def test_a_killed_run_leaves_no_process_and_goes_on_with_the_step_it_was_in(tmp_path):
    script = (
        "import sys; from pathlib import Path\n"
        "from offboard.reproduction.step_runner import Step, run\n"
        f"steps = [{FIRST!r}, {simulation(1e6)!r}]\n"
        f"run(Path({str(tmp_path)!r}), steps, 1, lambda line: print(line, flush=True))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("path:"):
                break
        while not (tmp_path / "path" / "config.yaml").exists():
            with contextlib.suppress(subprocess.TimeoutExpired):
                pytest.fail(f"ended by itself: {process.wait(0.05)}")
        process.send_signal(signal.SIGKILL)
    begun = [FIRST, simulation(1e6)]
    assert set(finished(tmp_path, begun)) == {"first"}
    # The lock is held by whoever still works in the folder, the killed run's steps included.
    with runner._folder_lock(tmp_path):
        pass
    before = (tmp_path / "first" / MARKER).stat()
    said: list[str] = []
    made = run(tmp_path, [FIRST, simulation(1)], 1, said.append)
    assert said[0] == "1 of 2 steps are done already"
    assert not any(line.startswith("first:") for line in said)
    assert (tmp_path / "first" / MARKER).stat() == before
    assert list(made) == ["first", "path"]
    assert made["path"].command.startswith("klab simulate --config first/config.yaml")
    assert (tmp_path / "path" / "summary.json").exists()
    marker = json.loads((tmp_path / "path" / MARKER).read_text())
    written = {file.name for file in (tmp_path / "path").iterdir()} - {MARKER}
    assert marker["sha256"].keys() == written
    assert marker["arguments"] == list(simulation(1).arguments)


def test_a_step_that_fails_stops_the_run_with_one_message_that_names_its_log(tmp_path):
    wrong = Step("first", ("train", "nowhere", "--out", "first/model.npz"))
    with pytest.raises(LabStateError, match="step first failed") as caught:
        run(tmp_path, [wrong, simulation(1)], 2, nothing)
    log = tmp_path / "logs" / "first.txt"
    assert str(log) in str(caught.value)
    assert "nowhere" in str(caught.value)
    assert "nowhere" in log.read_text()
    assert "Traceback" not in log.read_text()
    assert not (tmp_path / "path").exists()
    assert not finished(tmp_path, [wrong])


def mark(folder, *steps):
    for step in steps:
        (folder / step.name).mkdir(exist_ok=True)
        facts = {"arguments": list(step.arguments), "seconds": 1.0, "version": "0"}
        (folder / step.name / MARKER).write_text(json.dumps(facts))


def test_what_is_made_of_something_that_runs_again_runs_again(tmp_path):
    mark(tmp_path, FIRST, simulation(1))
    assert set(finished(tmp_path, [FIRST, simulation(1)])) == {"first", "path"}
    # A command with other arguments than the one that was run is another one.
    assert set(finished(tmp_path, [FIRST, simulation(2)])) == {"first"}
    (tmp_path / "first" / MARKER).unlink()
    assert not finished(tmp_path, [FIRST, simulation(1)])


DAMAGES = {
    "a bit": lambda folder: (folder / "result.csv").write_bytes(b"1,3\n"),
    "a file": lambda folder: (folder / "result.csv").unlink(),
    "the marker": lambda folder: (folder / MARKER).write_text('{"arguments": 3}'),
    "half the marker": lambda folder: os.truncate(folder / MARKER, 20),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_a_step_brought_is_made_again_where_it_is_damaged(damage, tmp_path, caplog):
    first = Step("first", ("log", "info", str(PARK)))
    (tmp_path / "first").mkdir()
    (tmp_path / "first" / "result.csv").write_text("1,2\n")
    resumed = dataclasses.replace(first, resumable=True)
    facts = {"arguments": list(first.arguments), "seconds": 1.0, "version": "0"}
    hashes = {"result.csv": sha256(tmp_path / "first" / "result.csv")}
    (tmp_path / "first" / MARKER).write_text(json.dumps(facts | {"sha256": hashes}))
    assert set(finished(tmp_path, [resumed])) == {"first"}
    assert not caplog.records
    DAMAGES[damage](tmp_path / "first")
    assert not finished(tmp_path, [resumed])
    assert [r.getMessage().endswith("the step is run again") for r in caplog.records] == [True]


def test_a_step_that_can_go_on_does_unless_what_it_needs_was_made_anew(tmp_path):
    first = Step("first", ("log", "info", str(PARK)))
    # It reads nothing of the first step, but names its folder. It cannot go on, and says so.
    second = Step("second", ("log", "info", f"first/../{PARK.name}"), resumable=True)
    (tmp_path / PARK.name).symlink_to(PARK)
    mark(tmp_path, first)
    (tmp_path / "second").mkdir()
    (tmp_path / "second" / "begun").touch()
    with pytest.raises(LabStateError, match="step second failed"):
        run(tmp_path, [first, second], 1, nothing)
    assert "--resume" in (tmp_path / "logs" / "second.txt").read_text()
    assert (tmp_path / "second" / "begun").exists()
    (tmp_path / "first" / MARKER).unlink()
    assert set(run(tmp_path, [first, second], 1, nothing)) == {"first", "second"}
    assert not (tmp_path / "second" / "begun").exists()


def test_nothing_runs_when_all_is_done(tmp_path):
    mark(tmp_path, FIRST)
    assert run(tmp_path, [FIRST], 1, nothing)["first"].seconds == 1.0
    assert not (tmp_path / "logs").exists()


def test_two_cannot_work_in_one_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "LOCK_LIMIT_S", 0.0)
    with (
        runner._folder_lock(tmp_path),
        pytest.raises(LabStateError, match="another `klab reproduce`"),
    ):
        run(tmp_path, [], 1, nothing)


def test_a_folder_with_something_else_or_another_reproduction_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("not of a reproduction")
    refused = klab("reproduce", "--quick", "--out", tmp_path)
    assert refused.returncode == 2
    assert "--out" in refused.stderr
    assert [f.name for f in tmp_path.iterdir()] == ["mine.txt"]
    place = tmp_path / "begun"
    place.mkdir()
    (place / "reproduction.json").write_text('{"quick": true, "seed": 1}')
    for asked, said in (
        (["--quick"], "--resume"),
        (["--resume"], "with --quick"),
        (["--resume", "--quick", "--seed", "2"], "--seed 1"),
    ):
        refused = klab("reproduce", *asked, "--out", place)
        assert refused.returncode == 2
        assert said in " ".join(refused.stderr.split())
