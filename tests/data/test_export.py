"""Logs written for other programs hold what the log holds."""

import csv
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from koopman_lab.bus.channels import MPC_STATE
from koopman_lab.bus.message_values import plain_values
from koopman_lab.data.export import export_csv, export_mcap
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.rotated_log import read_rotated_log

PARK = Path(__file__).parent / "reference" / "park.lcm"


@pytest.fixture(scope="module")
def events():
    return read_rotated_log(PARK)


def test_csv_has_a_file_a_channel_with_a_row_a_message(events, tmp_path):
    written = export_csv(events, tmp_path / "csv")
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


def test_mcap_is_read_back_by_its_own_reader_message_by_message(events, tmp_path):
    file = tmp_path / "park.mcap"
    export_mcap(events, file)
    with file.open("rb") as stream:
        read = list(make_reader(stream).iter_messages())
    assert len(read) == len(events)
    mpc = [
        (schema, message) for schema, channel, message in read if channel.topic == "R1_MPC_STATE"
    ]
    theirs = [event for event in events if event.channel == "R1_MPC_STATE"]
    for (schema, message), event in zip(mpc, theirs, strict=True):
        values = plain_values(MPC_STATE.type.decode(event.data))
        assert json.loads(message.data) == json.loads(json.dumps(values))
        assert message.log_time == event.timestamp_us * 1000
        assert message.publish_time == values["utime"] * 1000
        assert set(json.loads(schema.data)["properties"]) == set(values)


@pytest.mark.parametrize("export", [export_csv, export_mcap])
def test_what_cannot_be_decoded_is_left_out_and_counted(events, export, tmp_path):
    strange = [Event(0, 0, "OTHER", b"x"), Event(1, 0, "R1_ESTOP", b"short")]
    written = export([*strange, *events[:50]], tmp_path / "out")
    assert written.left_out == {"OTHER": 1, "R1_ESTOP": 1}
    with pytest.raises(LogError, match="no message of this lab to export, only OTHER"):
        export(strange[:1], tmp_path / "none")
    assert not (tmp_path / "none").exists()
