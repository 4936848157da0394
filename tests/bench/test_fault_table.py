"""Every row of the table of faults (`klab bench faults`), with the real nodes in lockstep."""

import io
from dataclasses import asdict
from typing import get_args

import pytest
from klab import klab, klab_json, klab_ok
from rich.console import Console

from koopman_lab.config.fault_kinds import FaultKind
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.robots.table import ROBOTS
from offboard.bench.faults.fault_rows import Row, as_table, run_scenario
from offboard.bench.faults.scenario import Scenario
from offboard.bench.faults.scenarios import SCENARIOS
from offboard.bench.faults.strikes import Inject
from offboard.terminal.exit_codes import ExitCode

ROWS = pytest.mark.parametrize(
    ("robot", "scenario"),
    [
        pytest.param(robot.name, scenario, id=f"{robot.name}, {scenario.name}, {scenario.activity}")
        for scenario in SCENARIOS
        for robot in ROBOTS
        if scenario.is_for(robot)
    ],
)
REFUSED = {
    "command that is no number": {"value": 1},
    "command of 5 s ago once more": {"stale": 1},
}
DRIVES_ON_M = 0.3
"""Way that a robot that drives on has made by the end: most make twice as much."""


@ROWS
def test_the_robot_stops_in_time_or_drives_on_and_the_operator_is_told(robot, scenario):
    config = load_config(robot=robot)
    row = run_scenario(scenario, config)
    came = iter(row.states)
    for state in scenario.states:
        assert any(s.startswith(state) for s in came), row.states
    assert row.latched is any(s.startswith(("FAULT", "ESTOP")) for s in scenario.states[-1:])
    assert scenario.message in row.told
    assert row.beyond_floor_m == 0.0
    if scenario.bound is None:
        assert row.stood_after_s is None
        assert row.session == "goes on"
        assert row.rolled_m > DRIVES_ON_M
    else:
        assert row.stood_after_s is not None
        assert row.stood_after_s <= row.bound_s
        assert row.session != "goes on"
        assert bool(row.told) is bool(scenario.message)
    if scenario.name in REFUSED:
        assert row.refused == REFUSED[scenario.name]


def test_every_kind_of_fault_is_in_the_table():
    struck = {s.strike.fault.kind for s in SCENARIOS if isinstance(s.strike, Inject)}
    wrong = {fault.kind for s in SCENARIOS for fault in s.wrong}
    assert struck | wrong == set(get_args(FaultKind))


def test_a_scenario_ends_the_same_way_each_time():
    scenario = next(s for s in SCENARIOS if "half of all messages" in s.name)
    config = load_config(overrides=["controller.horizon=20"])
    assert asdict(run_scenario(scenario, config)) == asdict(run_scenario(scenario, config))


def test_only_a_fault_that_is_there_stops_the_robot():
    """The measure itself: nothing wrong, and the robot is not said to stand."""
    nothing = Scenario("nothing", Inject(Fault(kind="radio_cut", duration_s=0.0)), ("DRIVING",))
    row = run_scenario(nothing, load_config(overrides=["controller.horizon=20"]))
    assert row.states == ("DRIVING",)
    assert (row.stood_after_s, row.session, row.refused) == (None, "goes on", {})


def test_bench_faults_as_json_and_as_a_table():
    (row,) = klab_json("bench", "faults", "--only", "command of 5 s ago")
    assert row["refused"] == {"stale": 1}
    assert row["stood_after_s"] is None
    printed = klab_ok("bench", "faults", "--only", "sampler dies", "--robot", "dynamic")
    assert "faults of the dynamic robot" in printed


def test_the_table_cuts_no_word_off_in_a_narrow_terminal():
    scenario = next(s for s in SCENARIOS if s.activity == "calibrate" and "stalled" in s.name)
    told = "R1_ONBOARD_STATUS: the robot is stopped (right wheel stuck); `klab estop --release`"
    states = ("DRIVING", "FAULT RIGHT_WHEEL_STUCK")
    row = Row(
        *(scenario.name, scenario.activity, states, {"stopped": 76}, True),
        *(0.14, 0.57, 0.011, 9.0, 0.0, "has ended", told),
    )
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(as_table([row], "kinematic"))
    printed = console.export_text()
    assert "…" not in printed
    for word in ("RIGHT_WHEEL_STUCK;", "R1_ONBOARD_STATUS:", "--release`", "calibrate"):
        assert word in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_planned_faults_strike_without_a_message(tmp_path):
    """In lockstep too, a session that cannot go on ends and says why."""
    planned = "simulation.faults=[{kind: motor_stalled, wheel: right, at_s: 3}]"
    done = klab("calibrate", "--lockstep", "--set", planned, "--out", tmp_path / "session")
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "the robot is stopped (right wheel stuck)" in done.stderr
    assert "klab estop --release" in done.stderr
