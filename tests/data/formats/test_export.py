"""Logs written for other programs hold what the log holds, as readers of others read them."""

import csv
import json
import math
from pathlib import Path

import duckdb
import mat4py
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoders
from mcap_ros2.decoder import DecoderFactory as Ros2Decoders

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, MPC_STATE, VELOCITY_CMD, split_name
from koopman_lab.bus.message_values import plain_values
from koopman_lab.data.formats.matlab import LONGEST_NAME, variable_name
from koopman_lab.data.formats.table import FORMATS, writer_of
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.rotated_log import read_rotated_log

PARK = Path(__file__).parents[1] / "reference" / "park.lcm"
TOLERANCE = 1e-12


@pytest.fixture(scope="module")
def events():
    return read_rotated_log(PARK)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("formats")


def messages(events, channel):
    """Return the decoded messages of a channel of R1, and when each arrived (us)."""
    name = channel.name("R1")
    theirs = [event for event in events if event.channel == name]
    return [channel.type.decode(e.data) for e in theirs], [e.timestamp_us for e in theirs]


@pytest.mark.parametrize("name", FORMATS.builtin_names())
def test_what_cannot_be_decoded_is_left_out_and_counted(events, name, tmp_path):
    write = writer_of(name)
    strange = [Event(0, 0, "OTHER", b"x"), Event(1, 0, "R1_ESTOP", b"short")]
    written = write([*strange, *events[:50]], tmp_path / "out")
    assert written.left_out == {"OTHER": 1, "R1_ESTOP": 1}
    assert sum(written.channels.values()) + sum(written.without_form.values()) == 50
    with pytest.raises(LogError, match="no message of this lab to export, only OTHER"):
        write(strange[:1], tmp_path / "none")
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", FORMATS.builtin_names())
def test_times_and_numbers_that_cannot_be_break_no_format(name, tmp_path):
    """Whoever speaks on a bus says what he likes, and a log holds it."""
    strange = []
    for utime in (-(2**63), -1, 2**63 - 1):
        for value in (math.nan, -math.inf, 1e300):
            pose, step, command = (c.type() for c in (MOCAP_POSE, MPC_STATE, VELOCITY_CMD))
            pose.x1_m = pose.theta_rad = command.v_m_per_s = value
            pose.tracking_valid, step.goal = True, (value, 0.0, 0.0)
            step.horizon, step.predicted_x1_m, step.predicted_x2_m = 2, [value, 0], [0, value]
            for channel, message in (
                (MOCAP_POSE, pose),
                (MPC_STATE, step),
                (VELOCITY_CMD, command),
            ):
                message.utime, message.sequence = utime, -1
                strange.append(Event(0, utime, channel.name("1 x/\u202e"), message.encode()))
    written = writer_of(name)(strange, tmp_path / "out")
    assert sum(written.channels.values()) == len(strange)


def test_csv_has_a_file_a_channel_with_a_row_a_message(events, tmp_path):
    written = writer_of("csv")(events, tmp_path / "csv")
    names = {event.channel for event in events}
    assert {file.stem for file in (tmp_path / "csv").iterdir()} == names == set(written.channels)
    with (tmp_path / "csv" / "R1_MPC_STATE.csv").open() as file:
        rows = list(csv.DictReader(file))
    steps = [event for event in events if event.channel == "R1_MPC_STATE"]
    assert len(rows) == len(steps) == written.channels["R1_MPC_STATE"]
    # The prediction's length changes: what a row does not have is empty.
    driving = next(k for k, row in enumerate(rows) if int(row["horizon"]) > 0)
    message = MPC_STATE.type.decode(steps[driving].data)
    row = rows[driving]
    assert int(row["arrival_us"]) == steps[driving].timestamp_us
    assert float(row["goal[2]"]) == message.goal[2]
    assert float(row["predicted_x1_m[60]"]) == message.predicted_x1_m[60]
    assert rows[0]["predicted_x1_m[60]"] == ""


@pytest.fixture(scope="module")
def mcap(events, out):
    file = out / "park.mcap"
    writer_of("mcap")(events, file)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[ProtobufDecoders()])
        return list(reader.iter_messages(log_time_order=False)), file


def test_mcap_is_read_back_by_its_own_reader_message_by_message(events, mcap):
    read = [entry for entry in mcap[0] if entry[1].message_encoding == "json"]
    assert len(read) == len(events)
    for (schema, channel, message), event in zip(read, events, strict=True):
        row = split_name(event.channel)[1]
        values = plain_values(row.type.decode(event.data))
        assert channel.topic == event.channel
        assert json.loads(message.data) == json.loads(json.dumps(values))
        assert message.log_time == event.timestamp_us * 1000
        assert message.publish_time == values["utime"] * 1000
        assert schema.name == row.type.__name__
        assert set(json.loads(schema.data)["properties"]) == set(values)


def decoded(file, decoders):
    """Return by topic what an MCAP file holds, decoded by the schemas in it, and its time (ns)."""
    topics = {}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[decoders])
        wanted = [
            channel.topic
            for channel in reader.get_summary().channels.values()
            if channel.message_encoding != "json"
        ]
        for schema, channel, message, content in reader.iter_decoded_messages(topics=wanted):
            topics.setdefault((channel.topic, schema.name), []).append((message.log_time, content))
    return topics


def yaw(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def turned(one, other):
    """Return by how much two angles differ (rad), whole turns aside."""
    return abs(math.remainder(one - other, 2 * math.pi))


def test_foxglove_shows_the_lab_in_3d(events, mcap):
    """Decoded as Foxglove does: by the schemas that stand in the file."""
    topics = decoded(mcap[1], ProtobufDecoders())
    poses, arrivals = messages(events, MOCAP_POSE)
    steps, _ = messages(events, MPC_STATE)
    valid = [(p, at) for p, at in zip(poses, arrivals, strict=True) if p.tracking_valid]
    transforms = topics["/tf", "foxglove.FrameTransform"]
    in_frame = topics["/R1/pose", "foxglove.PoseInFrame"]
    assert len(transforms) == len(in_frame) == len(valid) > 200
    for (log_ns, transform), (_, pose), (message, at) in zip(
        transforms, in_frame, valid, strict=True
    ):
        assert log_ns == at * 1000
        assert (transform.parent_frame_id, transform.child_frame_id) == ("lab", "R1")
        assert transform.timestamp.ToMicroseconds() == message.utime
        assert (transform.translation.x, transform.translation.y) == (message.x1_m, message.x2_m)
        assert turned(yaw(transform.rotation), message.theta_rad) < TOLERANCE
        assert pose.frame_id == "lab"
        assert pose.pose.position.x == message.x1_m
    path = topics["/R1/path", "foxglove.PosesInFrame"]
    took_s = (valid[-1][0].utime - valid[0][0].utime) / 1e6
    assert len(path) == pytest.approx(took_s, abs=2)
    last = path[-1][1].poses
    assert len(last) == pytest.approx(10 * min(took_s, 30.0), abs=12)
    goals = topics["/R1/goal", "foxglove.PoseInFrame"]
    assert [(g.pose.position.x, g.pose.position.y) for _, g in goals] == [tuple(steps[0].goal[:2])]
    drawn = {}
    for _, update in topics["/R1/scene", "foxglove.SceneUpdate"]:
        for entity in update.entities:
            drawn.setdefault(entity.id, []).append(entity)
    assert drawn.keys() == {
        f"R1 {what}" for what in ("body", "floor", "X0", "Z", "goal", "predicted")
    }
    body = drawn["R1 body"][0]
    # Locked to the robot's frame, so that the transforms move it.
    assert (body.frame_id, body.frame_locked) == ("R1", True)
    assert [round(wheel.pose.position.y, 6) for wheel in body.cylinders] == [0.1, -0.1]
    assert len(drawn["R1 predicted"]) == len(steps)
    longest = max(drawn["R1 predicted"], key=lambda entity: len(entity.lines))
    step = next(s for s in steps if s.utime == longest.timestamp.ToMicroseconds())
    (line,) = longest.lines
    assert [p.x for p in line.points] == list(step.predicted_x1_m)


def test_a_bag_of_ros_2_is_read_by_who_knows_ros_and_not_us(events, tmp_path):
    folder = tmp_path / "bag"
    written = writer_of("ros2")(events, folder)
    assert {file.name for file in folder.iterdir()} == {"bag.mcap", "metadata.yaml"}
    topics = decoded(folder / "bag.mcap", Ros2Decoders())
    assert set(topics) == {
        ("/tf", "tf2_msgs/msg/TFMessage"),
        ("/R1/pose", "geometry_msgs/msg/PoseStamped"),
        ("/R1/cmd_vel", "geometry_msgs/msg/TwistStamped"),
        ("/R1/wheel_velocity", "geometry_msgs/msg/TwistStamped"),
        ("/R1/goal", "geometry_msgs/msg/PoseStamped"),
        ("/R1/plan", "nav_msgs/msg/Path"),
    }
    assert "R1_ENCODER" in written.without_form
    by_topic = {topic: rows for (topic, _), rows in topics.items()}
    poses, arrivals = messages(events, MOCAP_POSE)
    valid = [(p, at) for p, at in zip(poses, arrivals, strict=True) if p.tracking_valid]
    rows = zip(by_topic["/R1/pose"], by_topic["/tf"], valid, strict=True)
    for (time_ns, stamped), (_, tf), (message, at) in rows:
        assert time_ns == at * 1000
        stamp = stamped.header.stamp
        assert stamp.sec * 1_000_000 + stamp.nanosec // 1000 == message.utime
        assert stamped.header.frame_id == "lab"
        position = stamped.pose.position
        assert (position.x, position.y, position.z) == (message.x1_m, message.x2_m, 0.0)
        assert turned(yaw(stamped.pose.orientation), message.theta_rad) < TOLERANCE
        (transform,) = tf.transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("lab", "R1")
        assert transform.transform.translation.x == message.x1_m
    commands, _ = messages(events, VELOCITY_CMD)
    for (_, stamped), message in zip(by_topic["/R1/cmd_vel"], commands, strict=True):
        twist = stamped.twist
        assert (twist.linear.x, twist.angular.z) == (message.v_m_per_s, message.omega_rad_per_s)
    steps, _ = messages(events, MPC_STATE)
    planned = [step for step in steps if step.horizon]
    for (_, plan), step in zip(by_topic["/R1/plan"], planned, strict=True):
        assert [p.pose.position.x for p in plan.poses] == list(step.predicted_x1_m)


def test_a_file_for_matlab_is_read_by_another_reader(events, tmp_path):
    file = tmp_path / "park.mat"
    writer_of("mat")(events, file)
    read = mat4py.loadmat(str(file))
    assert {event.channel for event in events} == set(read)
    steps, arrivals = messages(events, MPC_STATE)
    table = read["R1_MPC_STATE"]
    # A column comes as a list of rows of one number each.
    assert [row[0] for row in table["arrival_us"]] == arrivals
    assert [row[0] for row in table["utime"]] == [step.utime for step in steps]
    assert [tuple(row) for row in table["goal"]] == [tuple(step.goal) for step in steps]
    assert [row[0] for row in table["solved"]] == [bool(step.solved) for step in steps]
    longest = max(step.horizon for step in steps)
    for row, step in zip(table["predicted_x1_m"], steps, strict=True):
        assert len(row) == longest
        assert row[: step.horizon] == list(step.predicted_x1_m)
        assert all(map(math.isnan, row[step.horizon :]))
    infos = [e for e in events if e.channel == "R1_SESSION_INFO"]
    texts = read["R1_SESSION_INFO"]["config_yaml"]
    assert np.ravel(texts)[0] == lcmtypes.session_info_t.decode(infos[0].data).config_yaml


def test_names_of_variables_are_matlabs_whatever_the_channels_are_called():
    taken: set[str] = set()
    for channel in ("R1_MOCAP_POSE", "1_X", "_X", "a b_X", "a-b_X", "\u202e_X", "x" * 70, "x" * 71):
        name = variable_name(channel, taken)
        assert name.isidentifier()
        assert name.isascii()
        assert name[0].isalpha()
        assert len(name) <= LONGEST_NAME
        assert name not in taken
        taken.add(name)
    assert "R1_MOCAP_POSE" in taken


def test_parquet_is_read_by_another_reader_with_its_types(events, tmp_path):
    folder = tmp_path / "parquet"
    written = writer_of("parquet")(events, folder)
    assert {file.stem for file in folder.iterdir()} == set(written.channels)

    def table(channel, columns):
        file = folder / f"{channel.name('R1')}.parquet"
        return duckdb.sql(f"select {columns} from read_parquet('{file}')").fetchall()

    steps, arrivals = messages(events, MPC_STATE)
    columns = "arrival_us, utime, state, solved, value_function, goal, predicted_x1_m"
    assert table(MPC_STATE, columns) == [
        (
            at,
            s.utime,
            s.state,
            bool(s.solved),
            s.value_function,
            list(s.goal),
            list(s.predicted_x1_m),
        )
        for s, at in zip(steps, arrivals, strict=True)
    ]
    (kinds,) = table(MPC_STATE, "typeof(utime), typeof(state), typeof(goal), typeof(solved)")[:1]
    assert kinds == ("BIGINT", "TINYINT", "DOUBLE[]", "BOOLEAN")
    poses, _ = messages(events, MOCAP_POSE)
    assert table(MOCAP_POSE, "max(x1_m), count(*)") == [(max(p.x1_m for p in poses), len(poses))]
