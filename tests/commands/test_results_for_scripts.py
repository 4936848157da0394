"""What scripts read of a run: its summary as JSON, and the exit code."""

import json
import re

import pytest
from klab import MODEL, REFERENCE, klab, klab_json, klab_ok

from offboard.terminal.exit_codes import ExitCode

SHORT_PARK = ("--lockstep", "--set", "controller.time_limit_s=2", "--set", "controller.horizon=20")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """Run the demo once; return its folder and what it said."""
    folder = tmp_path_factory.mktemp("demo") / "run"
    return folder, klab("demo", "--lockstep", "--json", "--out", folder)


def summary(folder):
    return json.loads((folder / "summary.json").read_text())


def test_a_demo_prints_its_summary_and_nothing_else(demo):
    folder, done = demo
    assert done.returncode == ExitCode.DONE, done.stderr
    assert json.loads(done.stdout) == {"folder": str(folder)} | summary(folder)
    assert json.loads(done.stdout)["passed"] is True


def test_a_calibration_prints_its_summary(tmp_path):
    folder = tmp_path / "session"
    done = klab("calibrate", "--lockstep", "--segments", "1", "--json", "--out", folder)
    assert done.returncode == ExitCode.DONE, done.stderr
    facts = json.loads(done.stdout)
    assert facts == {"folder": str(folder)} | summary(folder)
    assert (facts["what"], facts["complete"], facts["segments"]) == ("calibrate", True, 2)


def test_who_is_not_parked_says_so_by_the_code_too(tmp_path):
    folder = tmp_path / "park"
    done = klab("park", "--model", MODEL, *SHORT_PARK, "--json", "--out", folder)
    assert done.returncode == ExitCode.NO
    facts = json.loads(done.stdout)
    assert facts == {"folder": str(folder)} | summary(folder)
    assert (facts["what"], facts["parked"]) == ("park", False)
    assert facts["reason"]


def test_a_model_is_trained_from_the_folder_of_a_demo_and_never_replaced_silently(demo, tmp_path):
    """The session is in a folder of its own there, and so is the model made of it."""
    folder, _ = demo
    klab_ok("train", folder)
    model = folder / "calibration" / "model.npz"
    before = model.read_bytes()
    refused = klab("train", folder, "--dictionary", "D6Eul")
    assert refused.returncode == ExitCode.MISUSE
    assert f"{model}: is there already" in refused.stderr
    assert "--overwrite" in refused.stderr
    assert model.read_bytes() == before
    klab_ok("train", folder, "--dictionary", "D6Eul", "--overwrite")
    assert model.read_bytes() != before
    for command in (("log", "info"), ("log", "verify"), ("dataset", "info")):
        klab_ok(*command, folder)
    klab_ok("dataset", "make", folder, "--out", tmp_path / "data.npz")


def test_a_session_of_its_own_goes_before_one_below(tmp_path):
    for place in (tmp_path, tmp_path / "calibration"):
        place.mkdir(exist_ok=True)
    (tmp_path / "calibration" / "session.lcm").write_bytes(b"")
    whole = (REFERENCE / "park.lcm").read_bytes()
    (tmp_path / "session.lcm").write_bytes(whole)
    assert f"{tmp_path / 'session.lcm'}, " in klab_ok("log", "info", tmp_path).replace("\n", "")


def test_what_was_run_is_listed_in_a_line_each(demo):
    folder, _ = demo
    rows = {row["folder"]: row for row in klab_json("runs", folder)}
    assert set(rows) == {str(folder), *(str(folder / part) for part in ("calibration", "park"))}
    park = rows[str(folder / "park")]
    assert (park["what"], park["outcome"], park["log"]) == ("park", "parked", True)
    assert park["used"] == {"model": str(folder / "model.npz"), "cost": "me", "seed": "1"}
    assert rows[str(folder / "calibration")]["outcome"] == "calibrated"
    lines = klab_ok("runs", folder).splitlines()
    assert len(lines) == len(rows)
    (line,) = (line for line in lines if f"{folder / 'park'}  " in line)
    assert re.search(r"^\d{4}-\d\d-\d\d \d\d:\d\d  park +model.npz  .*  parked \(.* mm and ", line)
    assert klab_ok("runs", folder, "--last", "1").split() == lines[-1].split()


def test_a_folder_without_runs_is_said(tmp_path):
    done = klab("runs", tmp_path)
    assert (done.returncode, done.stdout) == (ExitCode.DONE, "")
    assert "no run yet" in done.stderr
    missing = klab("runs", tmp_path / "none")
    assert missing.returncode == ExitCode.MISUSE
    assert "no such folder" in missing.stderr
