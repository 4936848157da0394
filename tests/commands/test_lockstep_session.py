"""The main job on virtual time, through the command line."""

import json

import numpy as np
import pytest
from klab import NO_RADIO_LOSS, klab, klab_json, klab_ok

from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.marker import without_offset
from koopman_lab.geometry.planar import ORIGIN
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.trainer import train

CHANNELS = {"MOCAP_POSE": 240.0, "ENCODER": 100.0, "WHEEL_STATE": 20.0, "VELOCITY_CMD": 20.0}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "calibration"
    klab_ok(
        *("calibrate", "--robot", "kinematic", "--lockstep", "--seed", "3", "--out", folder),
        *NO_RADIO_LOSS,
    )
    return folder


@pytest.fixture(scope="module")
def model(session):
    path = session.parent / "model.npz"
    klab_ok("train", session, "--out", path)
    return path


def test_a_session_leaves_log_configuration_and_summary(session):
    assert {p.name for p in session.iterdir()} == {"session.lcm", "config.yaml", "summary.json"}
    summary = json.loads((session / "summary.json").read_text())
    assert summary["complete"]
    assert summary["segments"] == 10
    assert set(summary["samples"]) == {"1", "2"}
    assert summary["messages_lost"] == 0
    # Half of some 6 ms round trip, at the first exchange.
    assert 0.002 < summary["clock_error_s"] < 0.01


def test_one_seed_gives_the_same_bytes_and_another_seed_does_not(tmp_path):
    short = ("calibrate", "--lockstep", "--segments", "1")
    for name, seed in (("a", "5"), ("b", "5"), ("c", "6")):
        klab(*short, "--seed", seed, "--out", tmp_path / name)
    logs = [(tmp_path / name / "session.lcm").read_bytes() for name in "abc"]
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


def test_log_info_as_json(session):
    facts = klab_json("log", "info", session / "session.lcm")
    for suffix, rate_hz in CHANNELS.items():
        row = facts["channels"][f"R1_{suffix}"]
        assert row["rate_hz"] == pytest.approx(rate_hz, rel=1e-3)
        assert row["count"] > 0
        assert row["lost"] == 0
    only = klab_json("log", "info", session, "--channel", "R1_ENCODER")
    assert list(only["channels"]) == ["R1_ENCODER"]


def test_training_reports_samples_rank_and_condition(session, tmp_path):
    report = klab_json("train", session / "session.lcm", "--out", tmp_path / "m.npz")
    assert [b["basis_index"] for b in report["bases"]] == [0, 1, 2]
    assert report["bases"][0]["excitation"] is None
    for basis in report["bases"][1:]:
        assert basis["excitation"]["rank"] == 5
        assert 1.0 <= basis["excitation"]["condition"] < 100.0
    learned = BilinearModel.load(tmp_path / "m.npz")
    assert np.array_equal(learned.matrices[0], np.eye(5))


def test_the_markers_are_found_where_they_are_and_the_model_is_of_the_robot(session, model):
    config = load_config(session / "config.yaml")
    (ahead, left, turn), body = (
        config.simulation.cameras.marker_offset,
        config.simulation.plant.body,
    )
    left_wheel, right_wheel = body.wheel_radius_factor
    # The point that stands still lies to the right of the axle's middle: koopman_lab.data.marker.
    aside = 0.5 * config.robot.track_width_m * body.track_width_factor
    left += aside * (left_wheel - right_wheel) / (left_wheel + right_wheel)
    found = klab_json("dataset", "info", session)["marker"]
    assert found["offset"] == pytest.approx([ahead, left, turn], abs=2e-4)
    offset = BilinearModel.load(model).marker_offset
    assert list(offset) == found["offset"]
    assert "mm ahead" in klab_ok("dataset", "info", session)
    as_seen = config.model_copy(
        update={"processing": config.processing.model_copy(update={"remove_marker_offset": False})}
    )
    seen, removed = DataSet.from_log(session, as_seen), DataSet.from_log(session)
    for index, X in seen.X.items():
        np.testing.assert_allclose(without_offset(X, offset), removed.X[index], atol=1e-12)
    assert train(seen, "D5t")[0].marker_offset == ORIGIN


def test_parking_ends_within_the_bounds_and_leaves_everything(model, tmp_path):
    out = tmp_path / "park"
    klab_ok("park", "--model", model, "--start", "0", "0.5", "0", "--lockstep", "--out", out)
    summary = json.loads((out / "summary.json").read_text())
    x1, x2, theta = summary["final_pose"]
    assert abs(x1) <= 0.030
    assert abs(x2) <= 0.010
    assert abs(theta) <= np.radians(5.0)
    assert summary["parked"] is True
    assert set(summary["solve_ms"]) == {"p50", "p99", "max"}
    # In lockstep: latency of the cameras, a frame at most, the radio, and half a tick.
    assert 5.0 < summary["pose_age_ms"]["p50"] <= summary["pose_age_ms"]["max"] < 30.0
    assert summary["missed_deadlines"] == summary["mocap_messages_lost"] == 0
    assert 0.0 < summary["duration_s"] < 25.0
    files = {"session.lcm", "config.yaml", "summary.json", "trajectory.csv"}
    assert {p.name for p in out.iterdir()} == files | {"path.pdf", "path.png"}
    rows = np.genfromtxt(out / "trajectory.csv", delimiter=",", names=True)
    assert len(rows) == summary["steps"]
    assert rows["x2_m"][0] == pytest.approx(0.5, abs=0.02)
    assert abs(rows["x2_m"][-1]) < 0.01


def test_another_goal_is_reached_too(model, tmp_path):
    out = tmp_path / "park"
    goal, start = ("0.6", "-0.3", "90"), ("-0.2", "-0.2", "170")
    klab_ok(
        *("park", "--model", model, "--start", *start, "--goal", *goal),
        *("--lockstep", "--out", out),
    )
    summary = json.loads((out / "summary.json").read_text())
    assert summary["goal"] == pytest.approx([0.6, -0.3, np.pi / 2])
    assert np.all(np.abs(summary["final_pose"]) <= [0.03, 0.01, np.radians(5.0)])


def test_demo_of_the_second_order_robot(tmp_path):
    out = tmp_path / "demo"
    printed = klab_ok(
        *("demo", "--robot", "dynamic", "--lockstep", "--segments", "12", "--out", out)
    )
    assert "parked within the bounds" in printed
    summary = json.loads((out / "summary.json").read_text())
    assert summary["passed"] is True
    assert BilinearModel.load(out / "model.npz").dictionary.name == "D8Eul"
