"""The table of processes, ours and those of others, and what derives from it."""

import pytest
import typer

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import CHANNELS, HEARTBEATS, all_channels, split_name
from koopman_lab.bus.commanders import commander_name, commander_number
from koopman_lab.bus.processes import (
    PROCESSES,
    STANDING,
    Process,
    Stop,
    build,
    commanders,
    in_stop_order,
    priority_of,
    process,
    stopping,
)
from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError, PluginError
from offboard.cli import run
from offboard.monitor.lab_view import LabView
from offboard.monitor.process_states import ProcessStates

OWN = [PROCESSES.builtin_row(name) for name in PROCESSES.builtin_names()]
STATE = Channel("LIDAR_STATE", lcmtypes.logger_status_t, 5.0, "lidar")


class Lidar:
    name = "lidar"

    def __init__(self, config):
        self.config = config

    def attach(self, port):
        """Listen to nothing."""

    def close(self):
        """Nothing is held."""


@pytest.fixture
def add():
    """Return what adds a row for this test."""
    names = []

    def register(row):
        PROCESSES.register(row.name, row)
        names.append(row.name)
        return row

    yield register
    for name in names:
        PROCESSES.unregister(name)


@pytest.mark.parametrize("row", OWN, ids=lambda row: row.name)
def test_every_row_says_what_is_there(row):
    assert set(row.needs) <= set(PROCESSES.builtin_names())
    assert row.name not in row.needs
    for target in filter(None, (row.factory, row.rebuild)):
        assert callable(PROCESSES.load(row.name, target))
    assert (row.name in HEARTBEATS) == bool(row.factory)
    # Who commands needs a robot, and comes to rest before anything else ends.
    assert row.commands == (row.stops is Stop.COMMANDER) == ("onboard" in row.needs)


def test_each_process_has_its_command_and_no_command_is_without_process():
    group = typer.main.get_command(run.app)
    assert set(group.list_commands(None)) == set(PROCESSES.builtin_names())
    for row in OWN:
        assert group.get_command(None, row.name).hidden == row.hidden


def test_who_commands_stops_first_and_the_logger_writes_down_the_rest():
    names = [row.name for row in in_stop_order()]
    assert names == [
        *("sampler", "controller", "reference", "slalom", "onboard", "plant", "driver", "mocap"),
        *("logger", "view", "pacer"),
    ]
    assert commanders() == stopping(Stop.COMMANDER) == set(names[:4])
    assert set(STANDING) < set(names)


def test_roles_and_channels_are_of_one_node_each():
    # The slalom drives in the operator's place.
    roles = [row.role for row in OWN if row.commands]
    assert len(set(roles)) == len(roles)
    for name in commanders() - {"slalom"}:
        assert commander_name(commander_number(name, 7)) == f"{name} (process 7)"
    assert commander_name(commander_number("slalom", 7)) == "operator (process 7)"
    assert len({channel.suffix for channel in CHANNELS}) == len(CHANNELS)
    assert all_channels() == CHANNELS


def test_the_faster_loop_goes_first():
    assert priority_of("plant") > priority_of("onboard") == priority_of("pacer")
    assert priority_of("onboard") > priority_of("sampler") == priority_of("who ever")


def test_a_node_of_others_is_built_heard_and_shown(add):
    row = add(Process("lidar", Lidar, needs=("onboard",), priority=13, channels=(STATE,)))
    config = load_config()
    assert build("lidar", config).config is config
    assert priority_of("lidar") == 13
    assert HEARTBEATS["lidar"].suffix == "LIDAR_HEARTBEAT"
    assert "lidar" in set(HEARTBEATS)
    assert {"LIDAR_HEARTBEAT", "LIDAR_STATE"} < {channel.suffix for channel in all_channels()}
    assert split_name("R1_LIDAR_STATE") == ("R1", STATE)
    assert STATE.rate_hz(config) == 5.0
    assert [r.name for r in in_stop_order()].index("lidar") == 4
    assert not channels.channel_faults()
    beat = lcmtypes.node_status_t()
    beat.pid = 7
    view = LabView(config)
    view.take("R1_LIDAR_HEARTBEAT", beat.encode(), 0)
    (entry,) = view.robots["R1"].entries(0)
    assert (entry.name, entry.state, entry.pid) == ("lidar", "alive", 7)
    assert (entry.needs, entry.stopped_by) == (row.needs, row.stopped_by)


def test_a_node_of_others_may_command(add):
    add(Process("dance", Lidar, needs=("onboard",), stops=Stop.COMMANDER, role=5))
    assert commander_name(commander_number("dance", 7)) == "dance (process 7)"
    assert "dance" in commanders()


def test_a_row_that_cannot_be_used_is_shown_all_the_same(monkeypatch):
    def broken(name):
        raise PluginError(name)

    monkeypatch.setattr(PROCESSES, "get", broken)
    assert process("lidar") == Process("lidar", "")
    assert process("onboard").needs == ("plant",)
    monkeypatch.setattr(PROCESSES, "plugin_names", lambda: ("lidar",))
    processes = ProcessStates()
    beat = lcmtypes.node_status_t()
    processes.take_heartbeat("lidar", beat.encode(), 0)
    assert [entry.name for entry in processes.entries(0)] == ["lidar"]
    assert HEARTBEATS["lidar"].publisher == "lidar"


def test_an_unknown_process_is_a_clear_mistake():
    with pytest.raises(ConfigError, match=r"unknown node 'onbord'.*did you mean onboard"):
        process("onbord")
    assert "view" not in HEARTBEATS
    with pytest.raises(KeyError):
        HEARTBEATS["onbord"]


def test_a_node_with_another_name_would_have_no_heartbeat_and_is_refused(add):
    add(Process("radar", Lidar))
    with pytest.raises(PluginError, match=r"node 'radar': its node calls itself 'lidar'"):
        build("radar", load_config())


def test_a_channel_that_is_taken_stays_with_who_had_it(add):
    add(Process("lidar", Lidar, channels=(Channel("MPC_STATE", lcmtypes.goal_t, 1.0, "lidar"),)))
    assert split_name("R1_MPC_STATE") == ("R1", channels.MPC_STATE)
    message = channels.channel_faults()["lidar"]
    assert "node 'lidar': its channel MPC_STATE is that of the controller already" in message


@pytest.mark.parametrize("wrong", [{"role": 0}, {"role": 8}, {"priority": 0}, {"priority": 100}])
def test_what_is_no_role_or_priority_is_refused(wrong):
    with pytest.raises(ValueError, match="of lidar: expected 1 to"):
        Process("lidar", Lidar, **wrong)
