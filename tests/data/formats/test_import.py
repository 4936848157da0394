"""Recordings of other programs become sessions that train like our own."""

import math

import numpy as np
import pytest
from foxglove import Channel, Context, open_mcap
from foxglove.messages import Pose, PoseInFrame, Quaternion, Timestamp, Vector3
from hypothesis import given
from hypothesis import strategies as st
from klab import REFERENCE, klab
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from synthetic_session import EPOCH_US, Session

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.formats.held_inputs import basis_index, held_inputs
from koopman_lab.data.formats.table import writer_of
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.replay.rotated_log import read_rotated_log

CALIBRATION = REFERENCE / "calibration.lcm"


def imported(recording, out, *options):
    done = klab("log", "import", recording, "--out", out, *options)
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.parametrize("name", ["calibration", "park"])
def test_what_was_exported_becomes_the_log_that_it_was(name, tmp_path):
    events = read_rotated_log(REFERENCE / f"{name}.lcm")
    writer_of("mcap")(events, tmp_path / "log.mcap")
    said = imported(tmp_path / "log.mcap", tmp_path / "again")
    again = list(read_events(tmp_path / "again" / "session.lcm"))
    assert f"{len(events)} messages" in said
    assert [(e.channel, e.timestamp_us, e.data) for e in again] == [
        (e.channel, e.timestamp_us, e.data) for e in events
    ]


class Recorded:
    """A session of a robot that obeys exactly, as another program would have recorded it."""

    def __init__(self, kind):
        self.session = Session(kind, segments=3)
        self.poses = [(f.utime, (f.x1_m, f.x2_m, f.theta_rad)) for f in self.session.frames]
        m = len(next(iter(self.session.inputs.values())))
        self.commands = [
            (s.utime, tuple(s.u[: s.inputs]) if s.inputs else (9.0,) * m)
            for s in self.session.states
        ]

    def ros2(self, folder, storage, *, stamped=True, second_pose=False):
        store = get_typestore(Stores.ROS2_HUMBLE)
        make = lambda name, **fields: store.types[name](**fields)  # noqa: E731

        def header(utime):
            sec, us = divmod(utime, 1_000_000)
            time = make("builtin_interfaces/msg/Time", sec=sec, nanosec=us * 1000)
            return make("std_msgs/msg/Header", stamp=time, frame_id="world")

        def vector(x, z):
            return make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)

        def placed(pose):
            x1, x2, theta = pose
            return make(
                "geometry_msgs/msg/Pose",
                position=make("geometry_msgs/msg/Point", x=x1, y=x2, z=0.2),
                orientation=make(
                    "geometry_msgs/msg/Quaternion",
                    **{"x": 0.0, "y": 0.0, "z": math.sin(theta / 2), "w": math.cos(theta / 2)},
                ),
            )

        moving = "Twist" if self.session.model.name == "kinematic" else "Accel"
        command_type = f"geometry_msgs/msg/{moving}{'Stamped' if stamped else ''}"
        with Writer(folder, version=8, storage_plugin=storage) as bag:
            poses = bag.add_connection(
                "/robot/pose", "geometry_msgs/msg/PoseStamped", typestore=store
            )
            ghost = bag.add_connection("/ghost", "geometry_msgs/msg/PoseStamped", typestore=store)
            commands = bag.add_connection("/cmd", command_type, typestore=store)
            other = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
            text = store.types["std_msgs/msg/String"](data="hello")
            bag.write(other, 1, store.serialize_cdr(text, "std_msgs/msg/String"))
            for utime, pose in self.poses:
                message = make(
                    "geometry_msgs/msg/PoseStamped", header=header(utime), pose=placed(pose)
                )
                data = store.serialize_cdr(message, "geometry_msgs/msg/PoseStamped")
                bag.write(poses, utime * 1000 + 3_000_000, data)
                if second_pose:
                    bag.write(ghost, utime * 1000, data)
            for utime, (forward, turning) in self.commands:
                inner = make(
                    f"geometry_msgs/msg/{moving}",
                    linear=vector(forward, 0.0),
                    angular=vector(0.0, turning),
                )
                message = inner
                if stamped:
                    fields = {"header": header(utime), moving.lower(): inner}
                    message = make(command_type, **fields)
                late_ns = 3_000_000 if stamped else 0
                bag.write(
                    commands, utime * 1000 + late_ns, store.serialize_cdr(message, command_type)
                )


def same_pairs(imported_folder, session, tmp_path):
    """Compare the data set of an import with that of the session itself."""
    session.write(tmp_path / "own.lcm")
    own = DataSet.from_log(tmp_path / "own.lcm")
    again = DataSet.from_log(imported_folder)
    assert again.basis_inputs.keys() == own.basis_inputs.keys()
    for index in own.X:
        assert len(own.X[index]) > 20
        np.testing.assert_array_equal(again.start_us[index], own.start_us[index])
        np.testing.assert_array_equal(again.segments[index], own.segments[index])
        np.testing.assert_allclose(again.X[index], own.X[index], atol=1e-9)
        np.testing.assert_allclose(again.Y[index], own.Y[index], atol=1e-9)


def overrides(kind):
    return ("--robot", kind, "--set", "processing.discard_start_s=0")


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize(
    ("kind", "stamped"), [("kinematic", True), ("kinematic", False), ("dynamic", True)]
)
def test_a_bag_of_ros_2_trains_as_the_session_would(storage, kind, stamped, tmp_path):
    recorded = Recorded(kind)
    recorded.ros2(tmp_path / "bag", storage, stamped=stamped)
    said = imported(tmp_path / "bag", tmp_path / "session", *overrides(kind))
    assert f"{len(recorded.poses)} poses at 240 Hz of /robot/pose" in said
    same_pairs(tmp_path / "session", recorded.session, tmp_path)


def test_the_bag_of_a_real_session_finds_its_runs_and_trains(tmp_path):
    """Its commands as they were, drives between the runs included, and not the wheels' speeds."""
    writer_of("ros2")(read_rotated_log(CALIBRATION), tmp_path / "bag")
    own = DataSet.from_log(CALIBRATION)
    inputs = [list(map(float, u)) for u in own.basis_inputs.values()]
    basis = ("--set", f"sampler.basis_inputs={inputs}")
    said = imported(tmp_path / "bag", tmp_path / "session", *basis)
    assert "/R1/cmd_vel" in said
    again = DataSet.from_log(tmp_path / "session")
    for index in own.X:
        # The sampler's runs are among the stretches; marker and discarded start are the same.
        runs = len(np.unique(own.segments[index]))
        assert len(np.unique(again.segments[index])) >= runs
        own_times = set(own.start_us[index].tolist())
        assert len(own_times & set(again.start_us[index].tolist())) > 0.9 * len(own_times)


def test_a_file_of_foxgloves_own_library_is_read(tmp_path):
    """Poses as its SDK writes them, commands as ROS does."""
    recorded, context = Recorded("kinematic"), Context()
    file = tmp_path / "drive.mcap"
    recorded.ros2(tmp_path / "bag", StoragePlugin.MCAP)
    with open_mcap(file, context=context):
        from foxglove.channels import PoseInFrameChannel

        channel = PoseInFrameChannel("/pose", context=context)
        for utime, (x1, x2, theta) in recorded.poses:
            sec, us = divmod(utime, 1_000_000)
            channel.log(
                PoseInFrame(
                    timestamp=Timestamp(sec=sec, nsec=us * 1000),
                    frame_id="world",
                    pose=Pose(
                        position=Vector3(x=x1, y=x2, z=0.0),
                        orientation=Quaternion(
                            x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2)
                        ),
                    ),
                ),
                log_time=utime * 1000,
            )
        notes = Channel("/notes", context=context)
        notes.log({"text": "no pose"}, log_time=EPOCH_US * 1000)
    done = klab("log", "import", file, "--out", tmp_path / "none")
    assert done.returncode == 2
    assert "no topic with commands" in done.stderr
    assert "/pose (foxglove.PoseInFrame)" in done.stderr
    assert not (tmp_path / "none").exists()


def test_what_is_no_recording_or_lacks_something_is_refused_in_words(tmp_path):
    recorded = Recorded("kinematic")
    recorded.ros2(tmp_path / "bag", StoragePlugin.SQLITE3)
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("no MCAP at all")
    (tmp_path / "other.txt").write_text("x")
    cases = {
        "no such file": (tmp_path / "absent.mcap",),
        "give a file that ends in .mcap; or the folder of a ROS 2 bag": (tmp_path / "empty",),
        "cannot be read as MCAP": (tmp_path / "text.mcap",),
        "no recording that can be read": (tmp_path / "other.txt",),
        "--poses /nowhere: not a topic with poses": (tmp_path / "bag", "--poses", "/nowhere"),
        "no topic with commands (geometry_msgs/msg/AccelStamped": (
            *(tmp_path / "bag", "--robot", "dynamic"),
        ),
        "no basis input of the configuration was held for": (
            *(tmp_path / "bag", "--set", "sampler.basis_inputs=[[0.1, 0.1], [0.1, -0.1]]"),
        ),
        "mocap.rate_hz": (tmp_path / "slow",),
    }
    recorded.poses = recorded.poses[::100]
    recorded.ros2(tmp_path / "slow", StoragePlugin.MCAP)
    for words, arguments in cases.items():
        done = klab("log", "import", *arguments, "--out", tmp_path / "out")
        assert done.returncode == 2, (words, done.stderr)
        assert words in done.stderr
        assert "Traceback" not in done.stderr
        assert not (tmp_path / "out").exists()
    # What was held longest is what a person may have meant.
    u = next(iter(recorded.session.inputs.values()))
    done = klab(
        "log", "import", *cases["no basis input of the configuration was held for"], "--out", "x"
    )
    assert f"{list(u)} for " in done.stderr


def test_of_several_topics_one_must_be_named(tmp_path):
    recorded = Recorded("kinematic")
    recorded.ros2(tmp_path / "bag", StoragePlugin.MCAP, second_pose=True)
    arguments = (tmp_path / "bag", *overrides("kinematic"), "--out", tmp_path / "session")
    done = klab("log", "import", *arguments)
    assert done.returncode == 2
    assert "several topics with poses: /ghost, /robot/pose; say which with --poses" in done.stderr
    assert klab("log", "import", *arguments, "--poses", "/robot/pose").returncode == 0
    same_pairs(tmp_path / "session", recorded.session, tmp_path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_or_changed_is_one_expected_mistake(share, tmp_path):
    events = list(read_events(CALIBRATION))[:2000]
    writer_of("mcap")(events, tmp_path / "whole.mcap")
    whole = (tmp_path / "whole.mcap").read_bytes()
    place = int(share * len(whole))
    for name, content in {
        "cut": whole[:place],
        "changed": whole[:place] + bytes(64) + whole[place + 64 :],
    }.items():
        file = tmp_path / f"{name}.mcap"
        file.write_bytes(content)
        done = klab("log", "import", file, "--out", tmp_path / name)
        assert done.returncode in (0, 2)
        assert "Traceback" not in done.stderr
        assert (tmp_path / name).exists() == (done.returncode == 0)


STEP_US = 50_000


@given(
    st.lists(st.tuples(st.sampled_from([0, 1, 2]), st.integers(1, 20), st.booleans()), min_size=1),
    st.floats(-1e-7, 1e-7),
)
def test_inputs_are_held_from_the_first_command_to_the_next_other_one(pieces, noise):
    """Pieces of commands at a steady rate, some with a silence of 2 s behind."""
    inputs = {1: (0.2, -0.5), 2: (0.2, 0.5)}
    values = {0: (0.0, 0.0), **inputs}
    times, rows, expected, now = [], [], [], 0
    for index, count, silent in pieces:
        joins = expected and expected[-1][0] == index and expected[-1][2] == now
        start = expected.pop()[1] if joins else now
        times += [now + k * STEP_US for k in range(count)]
        rows += [values[index]] * count
        now += count * STEP_US
        expected.append((index, start, now))
        now += 2_000_000 if silent else 0
    u = np.array(rows) + noise
    held = held_inputs(np.array(times, np.int64), u)
    if len(times) > 1 and np.median(np.diff(times)) == STEP_US:
        found = [(basis_index(u[h.first], inputs) or 0, h.start_us, h.end_us) for h in held]
        assert found == expected
    # Whatever the rate, every command is in one stretch.
    assert [k for h in held for k in range(h.first, h.stop)] == list(range(len(times)))
