"""Logs of older versions: those that are known are used as ever, the rest is passed over."""

import json

import numpy as np
import pytest
from klab import MODEL, OLDER, klab, klab_json, klab_ok
from older_messages import UNKNOWN, older, rewritten
from synthetic_session import Session

import lcmtypes
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.replay.rotated_log import read_rotated_log

CALIBRATION, PARK = OLDER / "calibration.lcm", OLDER / "park.lcm"
DATA_HASH = "cfb0c9836b0a3b9ae34085b018420a6543db952492669cdf0e24b74f7cec1cb8"
"""Of the data set that commit 5dcd815 made of the reference, whose messages had its layouts."""


def unknown(*channels):
    """Return a change that gives messages of these channels a fingerprint that nobody knows."""
    return lambda e: UNKNOWN + e.data[8:] if e.channel in channels else e.data


def test_the_data_set_of_an_older_log_is_what_it_was():
    dataset = DataSet.from_log(CALIBRATION)
    assert dataset.data_hash == DATA_HASH


def test_a_model_of_an_older_log_is_that_of_the_same_log_in_the_layouts_of_today(tmp_path):
    new = rewritten(CALIBRATION, tmp_path / "new.lcm", lambda e: e.data)
    assert new.read_bytes() != CALIBRATION.read_bytes()
    models = [
        train(DataSet.from_log(log), "D5t", Method(symmetric=True)) for log in (CALIBRATION, new)
    ]
    np.testing.assert_array_equal(models[0][0].matrices, models[1][0].matrices)
    assert models[0][1] == models[1][1]


@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_a_session_recorded_with_two_inputs_trains_to_the_last_bit(kind, tmp_path):
    session = Session(kind, segments=6)
    new = session.messages()
    states = iter(session.states)
    old = [
        (name, older(next(states)) if name == "R1_SAMPLER_STATE" else data, utime)
        for name, data, utime in new
    ]
    assert old != new
    logs = [
        session.write(tmp_path / name, messages)
        for name, messages in (("new.lcm", new), ("old.lcm", old))
    ]
    dictionary = "D5t" if kind == "kinematic" else "D8Eul"
    overrides = {"window": 10}
    one, other = (train(DataSet.from_log(log, **overrides), dictionary)[0] for log in logs)
    np.testing.assert_array_equal(one.matrices, other.matrices)


def test_unknown_types_that_are_not_needed_are_counted_and_passed_over(tmp_path):
    log = rewritten(CALIBRATION, tmp_path / "log.lcm", unknown("R1_WHEEL_STATE", "R1_TIME_SYNC"))
    counts = {name: SessionLog(log).channels[name].count for name in SessionLog(log).channels}
    words = (
        f"{log}: passed over messages of layouts unknown to this version, damaged, or of times "
        "that cannot be: "
        f"{counts['R1_TIME_SYNC']} of R1_TIME_SYNC, {counts['R1_WHEEL_STATE']} of R1_WHEEL_STATE"
    )
    for command in (
        ("train", log, "--symmetric", "--out", tmp_path / "model.npz"),
        ("dataset", "make", log, "--out", tmp_path / "data.npz"),
        ("log", "plot", log, "--out", tmp_path / "plot"),
        ("log", "info", log),
    ):
        done = klab(*command)
        assert done.returncode == 0, done.stderr
        assert done.stderr.count(words) == 1
    klab_ok("train", CALIBRATION, "--symmetric", "--out", tmp_path / "known.npz")
    models = [np.load(tmp_path / name)["matrices"] for name in ("model.npz", "known.npz")]
    np.testing.assert_array_equal(*models)
    done = klab("log", "export", log, "--out", tmp_path / "csv")
    assert done.returncode == 0
    assert f"R1_WHEEL_STATE: {counts['R1_WHEEL_STATE']} messages left out" in done.stderr


@pytest.mark.parametrize(
    ("channel", "command"),
    [
        ("R1_MOCAP_POSE", "train"),
        ("R1_SAMPLER_STATE", "train"),
        ("R1_MOCAP_POSE", "plot"),
        ("R1_MOCAP_POSE", "rerun"),
        ("R1_SAMPLER_HEARTBEAT", "rerun"),
    ],
)
def test_a_type_that_is_needed_is_refused_by_name(channel, command, tmp_path):
    log = rewritten(CALIBRATION, tmp_path / "log.lcm", unknown(channel))
    commands = {
        "train": ("train", log, "--symmetric"),
        "plot": ("log", "plot", log),
        "rerun": ("rerun", log, "--node", "sampler"),
    }
    done = klab(*commands[command])
    assert done.returncode == 2
    assert channel in done.stderr
    assert "version of koopman-lab that recorded the log" in " ".join(done.stderr.split())


def test_a_node_runs_again_without_the_outputs_that_cannot_be_read(tmp_path):
    log = rewritten(PARK, tmp_path / "log.lcm", unknown("R1_MPC_STATE"))
    facts = klab_json("rerun", log, "--node", "onboard", "--tolerance", "1e-6")
    assert facts["share"] == 1.0
    done = klab("rerun", log, "--node", "onboard", "--tolerance", "1e-6")
    count = SessionLog(PARK).channels["R1_MPC_STATE"].count
    assert f"{count} of R1_MPC_STATE" in done.stderr
    # The controller's goal stands in its first MPC_STATE: that one must be readable.
    done = klab("rerun", log, "--node", "controller", "--model", MODEL)
    assert done.returncode == 2
    assert "R1_MPC_STATE" in done.stderr
    log = rewritten(CALIBRATION, tmp_path / "other.lcm", unknown("R1_SAMPLER_STATE"))
    done = klab("rerun", log, "--node", "sampler", "--tolerance", "1e-6", "--json")
    facts = json.loads(done.stdout)
    # It begins later than it did: only once the rate of the cameras is known.
    assert 0.85 < facts["share"] < 1.0
    assert "R1_SAMPLER_STATE" not in facts["channels"]
    assert facts["channels"]["R1_VELOCITY_CMD"]["equal"] > 100


def test_a_replay_sends_the_messages_of_today():
    kinds = {"R1_SAMPLER_STATE": lcmtypes.sampler_state_t, "R1_MPC_STATE": lcmtypes.mpc_state_t}
    for log in (CALIBRATION, PARK):
        for event in read_rotated_log(log):
            if event.channel in kinds:
                kinds[event.channel].decode(event.data)
