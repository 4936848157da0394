"""Sessions whose cameras lie: what is left out, what is said, and what the rest is good for.

The sessions are recorded in the lab of preset `lab`; the lies are those of the emulation, told
afterwards, so that the robot drove as if they had not been.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from klab import klab_ok
from lying_cameras import lying_log

import lcmtypes
from koopman_lab.data.believable_frames import FAULTS
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.evaluation.session_verdict import recorded_verdicts, session_verdict
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.koopman.trainer import train

KINDS = {"kinematic": ("4", "D5t"), "dynamic": ("8", "D8Eul")}
WHEELS = [(), ("WHEEL_STATE",)]
RATE_HZ = 120.0
"""Half of the lab's, for logs of half the size."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for kind, (segments, _) in KINDS.items():
        small = ("--set", f"mocap.rate_hz={RATE_HZ}", "--set", "processing.smoothing_window=20")
        call = ("calibrate", "--robot", kind, "--segments", segments, "--lockstep")
        klab_ok(*call, *small, "--out", folder / kind)
    return {kind: folder / kind / "session.lcm" for kind in KINDS}


@pytest.fixture
def lying(logs, tmp_path):
    def record(robot, lie, **options):
        return DataSet.from_log(lying_log(logs[robot], lie, tmp_path / "lie.lcm", **options))

    return record


def texts(verdicts):
    return " ".join(reason.text for verdict in verdicts.values() for reason in verdict.reasons)


def account(dataset):
    return dataset.metadata["session"]


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize("silent", WHEELS, ids=["wheels", "no wheels"])
def test_a_session_of_honest_cameras_is_good_and_whole(logs, robot, silent, tmp_path):
    honest = DataSet.from_log(logs[robot])
    untouched = lying_log(
        logs[robot], "camera_slow", tmp_path / "l.lcm", at_s=2e6, leave_out=silent
    )
    dataset = DataSet.from_log(untouched)
    assert dataset.data_hash == honest.data_hash
    for verdict in recorded_verdicts(dataset).values():
        assert (verdict.level, verdict.reasons) == ("good", ())
    kept = account(dataset)
    assert kept["left_out"] == dict.fromkeys(FAULTS, 0)
    assert kept["used"] >= 0.99 * kept["expected"]
    assert kept["by_wheels"] is not bool(silent)
    assert json.loads(json.dumps(kept)) == kept


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize("silent", WHEELS, ids=["wheels", "no wheels"])
@pytest.mark.parametrize(
    ("lie", "fault", "share", "words"),
    [
        ("tracking_flipped", "flipped", 0.0067, "turned by 180 deg"),
        ("tracking_zero", "zero", 0.0016, "all zeros"),
        ("bodies_exchanged", "jumped", 0.05, "farther away than the robot can have driven"),
    ],
)
def test_single_frames_that_lie_are_left_out_and_the_rest_is_good(
    lying, logs, robot, silent, lie, fault, share, words
):
    dataset = lying(robot, lie, leave_out=silent)
    kept = account(dataset)
    others = {name: n for name, n in kept["left_out"].items() if n and name != fault}
    assert not others
    assert kept["left_out"][fault] == pytest.approx(share * kept["expected"], rel=0.5)
    verdicts = recorded_verdicts(dataset)
    assert (verdicts["session"].level, verdicts["data"].level) == ("weak", "good")
    assert words in texts(verdicts)
    model = train(dataset, KINDS[robot][1])[0]
    honest = train(DataSet.from_log(logs[robot]), KINDS[robot][1])[0]
    assert model_verdict(model).level == "good"
    np.testing.assert_allclose(model.matrices, honest.matrices, atol=0.05)


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize("silent", WHEELS, ids=["wheels", "no wheels"])
def test_a_pose_that_is_repeated_now_and_then_is_left_out(logs, robot, silent, tmp_path):
    """As NatNet does on loss: every 2 s the last pose for 0.3 s."""
    seen = []

    def frozen(frame, elapsed_s):
        if seen and elapsed_s % 2.0 < 0.3:
            frame.x1_m, frame.x2_m, frame.theta_rad = seen[-1]
        elif frame.tracking_valid:
            seen.append((frame.x1_m, frame.x2_m, frame.theta_rad))

    dataset = DataSet.from_log(changed_frames(logs[robot], tmp_path, frozen, leave_out=silent))
    kept = account(dataset)
    assert kept["left_out"]["frozen"] > 0.08 * kept["expected"]
    assert kept["left_out"]["frozen"] >= 0.99 * sum(kept["left_out"].values())
    verdicts = recorded_verdicts(dataset)
    assert (verdicts["session"].level, verdicts["data"].level) == ("weak", "good")
    assert "repeat the last pose while the robot moves" in texts(verdicts)
    assert model_verdict(train(dataset, KINDS[robot][1])[0]).level == "good"


@pytest.mark.parametrize("robot", KINDS)
def test_tracking_that_is_frozen_for_good_leaves_nothing(lying, robot):
    dataset = lying(robot, "tracking_frozen")
    assert account(dataset)["used"] == 0
    verdicts = recorded_verdicts(dataset)
    assert (verdicts["session"].level, verdicts["data"].level) == ("unusable", "unusable")
    assert "repeat the last pose" in texts(verdicts)


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize(
    ("lie", "cause"),
    [
        ("heading_negated", "the heading counts the other way round"),
        ("axes_exchanged", "x1 and x2 are exchanged"),
        ("x2_mirrored", "one axis counts the other way round"),
        ("frame_mirrored", "the frame is mirrored"),
        ("camera_unit", "positions are in mm"),
        ("camera_clock", "frames are stamped 10.0 s later than the wheels"),
    ],
)
def test_a_wrong_frame_unit_or_clock_is_named_and_its_data_are_unusable(lying, robot, lie, cause):
    dataset = lying(robot, lie)
    verdicts = recorded_verdicts(dataset)
    assert cause in verdicts["session"].text
    assert verdicts["data"].level == "unusable"
    # Its own guess from less is not printed beside that of the wheels.
    assert "likely" not in verdicts["data"].text
    assert model_verdict(train(dataset, KINDS[robot][1])[0]).level == "unusable"


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize(
    ("lie", "cause"),
    [
        ("heading_backwards", "the tracked body's axis points backwards"),
        ("heading_turned", "turned by 90 deg against each other"),
        ("frame_turned", "turned by 90 deg against each other"),
    ],
)
def test_a_body_that_is_turned_is_named_though_markers_may_be_anywhere(lying, robot, lie, cause):
    """Whoever drives by such poses goes astray; the data may be right, the turn taken out."""
    dataset = lying(robot, lie, at_s=0.0)
    verdicts = recorded_verdicts(dataset)
    assert verdicts["session"].level == "weak"
    assert cause in texts(verdicts)
    if dataset.metadata["marker"]["offset"] is None:
        assert verdicts["data"].level == "unusable"
    else:
        assert abs(dataset.metadata["marker"]["offset"][2]) > 1.5
        assert "define the body anew" in texts(verdicts)
        assert verdicts["data"].level == "good"


@pytest.mark.parametrize("robot", KINDS)
@pytest.mark.parametrize(
    ("lie", "words"),
    [
        ("sequence_stuck", "sequence does not count"),
        ("frames_doubled", "each message comes more than once"),
    ],
)
def test_frames_that_cannot_be_counted_are_named(lying, robot, lie, words):
    dataset = lying(robot, lie, at_s=0.0)
    verdicts = recorded_verdicts(dataset)
    assert not any(map(len, dataset.X.values()))
    assert verdicts["session"].level == "unusable"
    assert "R1_MOCAP_POSE (120 of 120 Hz)" in texts(verdicts)
    assert words in texts(verdicts)


def test_half_of_the_rate_is_refused_with_what_to_do(lying):
    with pytest.raises(DataError, match=r"60\.0 Hz, mocap\.rate_hz says 120; set mocap\.rate_hz"):
        lying("kinematic", "camera_slow")


def changed_frames(source, folder, change, leave_out=()):
    """Write a log with each frame changed by ``change(frame, elapsed_s)``; False leaves it out."""
    start_us, path = None, folder / "changed.lcm"
    with EventLogWriter(path) as log:
        for event in read_events(source):
            data = event.data
            if event.channel.split("_", 1)[1] in leave_out:
                continue
            if event.channel == "R1_MOCAP_POSE":
                frame = lcmtypes.mocap_pose_t.decode(data)
                start_us = frame.utime if start_us is None else start_us
                if change(frame, (frame.utime - start_us) / 1e6) is False:
                    continue
                data = frame.encode()
            log.write(event.channel, data, event.timestamp_us)
    return path


@pytest.mark.parametrize(
    ("factor", "said"), [(1e-3, "seems to be in ms"), (1e3, "seems to be in ns")]
)
def test_stamps_in_another_unit_are_named(logs, tmp_path, factor, said):
    def scaled(frame, _):
        frame.utime = round(frame.utime * factor)

    with pytest.raises(DataError, match=said):
        DataSet.from_log(changed_frames(logs["kinematic"], tmp_path, scaled))


def test_stamps_an_hour_off_leave_nothing_and_say_why(logs, tmp_path):
    def later(frame, _):
        frame.utime += 3_600_000_000

    dataset = DataSet.from_log(changed_frames(logs["kinematic"], tmp_path, later))
    judged = session_verdict(dataset.metadata)
    assert judged.level == "unusable"
    assert "no frame is stamped inside a run" in judged.text
    assert "stamped 3600.0 s later than the wheels" in texts({"session": judged})


def test_two_publishers_of_one_stream_are_named(logs, tmp_path):
    """The frames of another robot of the same name, 3 ms after each of ours."""
    path = tmp_path / "two.lcm"
    with EventLogWriter(path) as log:
        for event in read_events(logs["kinematic"]):
            log.write(event.channel, event.data, event.timestamp_us)
            if event.channel == "R1_MOCAP_POSE":
                frame = lcmtypes.mocap_pose_t.decode(event.data)
                frame.utime += 2_000
                frame.sequence += 90_000
                frame.x1_m, frame.x2_m, frame.theta_rad = 1.0, 1.0, 0.5
                log.write(event.channel, frame.encode(), event.timestamp_us)
    with pytest.raises(DataError, match=r"2 times as many.*klab topics"):
        DataSet.from_log(path)


def test_another_body_for_a_while_contradicts_the_wheels(logs, tmp_path):
    """A body that stands, with the noise of the cameras, for 8 s: no jump inside."""
    rng = np.random.default_rng(0)

    def exchanged(frame, elapsed_s):
        if 15.0 < elapsed_s < 23.0:
            noise = rng.standard_normal(3) * (2e-4, 2e-4, 9e-4)
            frame.x1_m, frame.x2_m, frame.theta_rad = (np.array([1.0, 0.4, 2.0]) + noise).tolist()

    dataset = DataSet.from_log(changed_frames(logs["kinematic"], tmp_path, exchanged))
    kept = account(dataset)
    assert kept["left_out"]["contradicting"] > 0
    verdicts = recorded_verdicts(dataset)
    assert verdicts["session"].level == "weak"
    assert verdicts["data"].level == "good"
    assert "contradict the wheels" in texts(verdicts)


def test_a_rate_that_is_not_kept_is_named(logs, tmp_path):
    """An overloaded machine takes 85 % of the frames, and numbers those that it takes."""
    taken = []

    def skipped(frame, _):
        place = frame.sequence
        if place % 20 in (0, 7, 14):
            return False
        frame.sequence = len(taken)
        taken.append(place)
        return None

    dataset = DataSet.from_log(changed_frames(logs["kinematic"], tmp_path, skipped))
    judged = session_verdict(dataset.metadata)
    assert judged.level == "unusable"
    assert "came at 102.0 Hz instead of mocap.rate_hz 120: cameras or machine do not keep up" in (
        judged.text
    )


def with_account(dataset, **changes):
    return dict(dataset.metadata) | {"session": account(dataset) | changes}


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        ({"pacing": {"plant": {"ticks": 9800, "missed": 200}}}, "weak", "plant skipped 2 %"),
        ({"pacing": {"plant": {"ticks": 8000, "missed": 2000}}}, "weak", "overloaded"),
        ({"pacing": {"plant": {"ticks": 9990, "missed": 10}}}, "good", ""),
        ({"used": 100, "invalid": 4000}, "unusable", "see that the cameras see the robot"),
        ({"left_out": {"flipped": 1}}, "good", "1 of"),
        ({"left_out": {"flipped": 90}}, "weak", "90 of"),
    ],
)
def test_each_figure_has_its_bound(logs, changes, level, words):
    dataset = DataSet.from_log(logs["kinematic"])
    judged = session_verdict(with_account(dataset, **changes))
    assert judged.level == level
    assert words in texts({"session": judged})


def test_lost_frames_are_named(logs):
    dataset = DataSet.from_log(logs["kinematic"])
    stream = account(dataset)["stream"] | {"lost": 1000}
    judged = session_verdict(with_account(dataset, stream=stream))
    assert judged.level == "weak"
    assert "were lost on their way" in judged.text


def test_a_data_set_of_an_older_version_has_no_verdict_on_its_session(logs):
    dataset = DataSet.from_log(logs["kinematic"])
    metadata = {key: value for key, value in dataset.metadata.items() if key != "session"}
    assert recorded_verdicts(replace(dataset, metadata=metadata)).keys() == {"data"}
