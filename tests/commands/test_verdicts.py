"""What is recorded and learned is judged where a person sees it; a wrong model does not drive."""

import json
import shutil

import pytest
from klab import OLDER, klab, klab_json, klab_ok
from lying_cameras import lying_log

from koopman_lab.koopman.bilinear_model import BilinearModel

SHORT_PARK = ("--lockstep", "--set", "controller.time_limit_s=1", "--set", "controller.horizon=5")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    klab_ok("calibrate", "--lockstep", "--seed", "1", "--out", folder / "session")
    klab_ok("train", folder / "session", "--out", folder / "model.npz")
    klab_ok("dataset", "export", folder / "session", "--out", folder / "dat")
    return folder


def summary(folder):
    return json.loads((folder / "summary.json").read_text())


def test_a_good_session_is_good_from_end_to_end(runs):
    verdict = summary(runs / "session")["verdict"]
    assert (verdict["level"], verdict["reasons"]) == ("good", [])
    assert verdict["figures"]["session"]["used"] > 8000
    stored = BilinearModel.load(runs / "model.npz").metadata["verdict"]
    assert stored["model"]["level"] == "good"
    assert stored["sources"] == [
        {name: {"level": "good", "reasons": []} for name in ("session", "data")}
    ]
    for said in (
        klab_ok("train", runs / "session", "--out", runs / "again.npz"),
        klab_ok("model", "info", runs / "model.npz"),
    ):
        assert said.endswith("session: good\ndata: good\nmodel: good\n")
    assert "session: good\ndata: good\n" in klab_ok("dataset", "info", runs / "session")
    made = klab("dataset", "make", runs / "session", "--out", runs / "d.npz")
    assert made.stderr.endswith("session: good\ndata: good\n")


def test_verdicts_as_json(runs):
    facts = klab_json("dataset", "info", runs / "session")
    assert {name: verdict["level"] for name, verdict in facts["verdicts"].items()} == {
        "session": "good",
        "data": "good",
    }
    facts = klab_json("train", runs / "session", "--out", runs / "j.npz")
    assert facts["verdict"]["model"]["level"] == "good"
    facts = klab_json("model", "info", runs / "model.npz")
    inputs = facts["verdict"]["model"]["figures"]["motion"]["inputs"]
    assert inputs["v"]["moved"] == pytest.approx(1.0, abs=0.05)
    assert inputs["omega"]["turned"] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("lie", "fault"),
    [("tracking_flipped", "flipped"), ("tracking_zero", "zero")],
)
def test_a_session_whose_cameras_lie_now_and_then_gives_a_model_that_parks(lie, fault, tmp_path):
    done = klab(
        *("calibrate", "--lockstep", "--seed", "2", "--out", tmp_path / "session"),
        *("--set", f"simulation.faults=[{{kind: {lie}, at_s: 2.0}}]"),
    )
    assert done.returncode == 0, done.stderr
    assert "session and data: weak" in done.stderr
    verdict = summary(tmp_path / "session")["verdict"]
    assert verdict["figures"]["session"]["left_out"][fault] > 0
    told = klab_ok("train", tmp_path / "session", "--out", tmp_path / "model.npz")
    assert "session: weak" in told
    assert told.endswith("data: good\nmodel: good\n")
    parked = klab("park", "--model", tmp_path / "model.npz", "--lockstep", "--out", tmp_path / "p")
    assert parked.returncode == 0, parked.stderr
    assert "model: weak\n  weak: its data:" in parked.stderr


def test_a_session_without_usable_samples_is_not_complete(tmp_path):
    done = klab(
        *("calibrate", "--lockstep", "--segments", "1", "--out", tmp_path / "session"),
        *("--set", "processing.discard_start_s=100"),
    )
    assert done.returncode == 1
    assert "session and data: unusable" in done.stderr
    assert "no sample of u_1, u_2" in done.stderr
    facts = summary(tmp_path / "session")
    assert (facts["complete"], facts["segments"], facts["samples"]) == (False, 2, {"1": 0, "2": 0})


def test_what_stopped_a_session_and_the_verdict_both_appear(tmp_path):
    done = klab(
        *("calibrate", "--lockstep", "--segments", "1", "--out", tmp_path / "session"),
        *("--set", "simulation.faults=[{kind: sequence_stuck, at_s: 0.0}]"),
    )
    assert done.returncode == 1
    assert "ended: " in done.stderr
    assert "session and data: unusable" in done.stderr
    facts = summary(tmp_path / "session")
    assert not facts["complete"]
    assert facts["reason"]
    assert facts["verdict"]["level"] == "unusable"


@pytest.mark.parametrize(
    ("lie", "words"),
    [("sequence_stuck", "does not count"), ("frames_doubled", "comes more than once")],
)
def test_a_recorded_session_that_cannot_be_counted_is_refused_with_the_reason(
    runs, lie, words, tmp_path
):
    log = lying_log(runs / "session" / "session.lcm", lie, tmp_path / "lie.lcm", at_s=0.0)
    done = klab("train", log, "--out", tmp_path / "model.npz")
    assert done.returncode == 2
    assert f"klab: {log}: R1_MOCAP_POSE" in done.stderr
    assert words in done.stderr
    assert not (tmp_path / "model.npz").exists()
    done = klab("dataset", "make", log, "--out", tmp_path / "data.npz")
    assert done.returncode == 0
    assert "session: unusable" in done.stderr


def exchanged(folder, runs, pairs):
    """Copy a folder of .dat files as one from elsewhere, files exchanged by name."""
    folder.mkdir()
    for name in ("X_1", "Y_1", "X_2", "Y_2"):
        shutil.copy(runs / "dat" / f"{name}.dat", folder / f"{pairs[name]}.dat")
    return folder


CASES = {
    "inputs": ({"X_1": "X_2", "Y_1": "Y_2", "X_2": "X_1", "Y_2": "Y_1"}, "u_1 and u_2 are exch"),
    "states": ({"X_1": "Y_1", "Y_1": "X_1", "X_2": "Y_2", "Y_2": "X_2"}, "Y_i.dat are exchanged"),
}


@pytest.mark.parametrize("case", CASES)
def test_exchanged_files_are_named_at_import_and_do_not_park(runs, case, tmp_path):
    pairs, words = CASES[case]
    theirs = exchanged(tmp_path / "theirs", runs, pairs)
    read = klab("dataset", "import", theirs, "--robot", "kinematic", "--dt", "0.05")
    assert read.returncode == 0
    told = klab_ok("train", tmp_path / "theirs.npz", "--out", tmp_path / "model.npz")
    for said in (read.stderr, told):
        assert "data: unusable" in said
        assert "the data contradict the basis inputs" in said
        assert words in said
    done = klab("park", "--model", tmp_path / "model.npz", *SHORT_PARK, "--out", tmp_path / "park")
    assert done.returncode == 2
    assert done.stderr.startswith("klab: the model (D5t) must not drive a robot")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "park").exists()


def test_a_wrong_model_is_refused_by_whatever_drives(runs, tmp_path):
    theirs = exchanged(tmp_path / "theirs", runs, CASES["states"][0])
    told = ("--robot", "kinematic", "--dt", "0.05")
    klab_ok("train", theirs, *told, "--out", tmp_path / "model.npz")
    for command in (
        ("compare", "--model", tmp_path / "model.npz", *SHORT_PARK, "--out", tmp_path / "c"),
        ("run", "controller", "--model", tmp_path / "model.npz"),
    ):
        done = klab(*command)
        assert done.returncode == 2, command
        assert "must not drive a robot" in done.stderr
    # The nominal equations take nothing of it but where the markers are.
    nominal = ("--set", "controller.predict=nominal")
    done = klab(
        "park", "--model", tmp_path / "model.npz", *SHORT_PARK, *nominal, "--out", tmp_path / "n"
    )
    assert done.returncode == 1
    assert "not parked (not parked after" in done.stderr


@pytest.fixture(scope="module")
def narrow(runs):
    """Record a session of a robot that is half as wide, and knows it."""
    width = (
        "--set",
        "robot.track_width_m=0.1",
        "--set",
        "simulation.plant.body.track_width_factor=1",
    )
    klab_ok("calibrate", "--lockstep", *width, "--out", runs / "narrow")
    return runs / "narrow"


def test_robots_of_another_geometry_are_not_mixed(runs, narrow, tmp_path):
    done = klab("train", runs / "session", narrow, "--out", tmp_path / "mixed.npz")
    assert done.returncode == 2
    assert "track_width_m is 0.2 in the first, 0.1 in another one" in done.stderr
    assert not (tmp_path / "mixed.npz").exists()
    klab_ok("train", narrow, "--out", tmp_path / "narrow.npz")
    for model, width, other in (
        (runs / "model.npz", 0.1, 0.2),
        (tmp_path / "narrow.npz", 0.2, 0.1),
    ):
        set_to = ("--set", f"robot.track_width_m={width}")
        done = klab("park", "--model", model, *SHORT_PARK, *set_to, "--out", tmp_path / "park")
        assert done.returncode == 2
        assert f"robot.track_width_m {other}, the lab says {width}" in done.stderr
    assert not (tmp_path / "park").exists()


def test_a_width_that_was_measured_again_is_a_warning(runs, tmp_path):
    set_to = ("--set", "robot.track_width_m=0.201")
    done = klab(
        "park", "--model", runs / "model.npz", *SHORT_PARK, *set_to, "--out", tmp_path / "p"
    )
    assert done.returncode == 1
    assert "weak: it was trained with robot.track_width_m 0.2, the lab says 0.201" in done.stderr


def test_a_wheel_of_another_size_than_stated_is_named(tmp_path):
    """Beyond what the data say themselves, nobody knows of it."""
    wide = ("--set", "simulation.plant.body.track_width_factor=1.6")
    done = klab("calibrate", "--lockstep", *wide, "--out", tmp_path / "session")
    assert "robot.wheel_radius_m, robot.track_width_m" in done.stderr


def test_a_model_of_the_version_before_parks_without_a_word(tmp_path):
    assert "verdict" not in BilinearModel.load(OLDER / "model.npz").metadata
    done = klab("park", "--model", OLDER / "model.npz", *SHORT_PARK, "--out", tmp_path / "park")
    assert done.returncode == 1
    assert "not parked (not parked after" in done.stderr
    assert "model:" not in done.stderr
    assert klab_ok("model", "info", OLDER / "model.npz").endswith("model: good\n")


def test_a_paper_s_dictionary_that_is_merely_poor_drives_with_a_warning(tmp_path):
    klab_ok(
        *("calibrate", "--robot", "dynamic", "--segments", "12", "--lockstep"),
        *("--out", tmp_path / "session"),
    )
    told = klab_ok(
        *("train", tmp_path / "session", "--dictionary", "D10m", "--out", tmp_path / "D10m.npz")
    )
    assert "model: weak" in told
    done = klab("park", "--model", tmp_path / "D10m.npz", *SHORT_PARK, "--out", tmp_path / "park")
    assert done.returncode == 1
    assert done.stderr.startswith("model: weak\n")
    assert "not parked (not parked after" in done.stderr
