"""Random sequences of faults, lies, deaths and orders, judged by the plant's truth alone."""

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, example, given, note, settings
from hypothesis import strategies as st

from koopman_lab.config.fault_kinds import FAULT_KINDS
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.geometry.planar import Pose, relative_to
from koopman_lab.robots.table import ROBOTS
from offboard.bench.faults.stage import Stage, is_at_rest
from offboard.bench.faults.strikes import Inject, estop, kill, second_commander, send_to
from offboard.desk.floor import Floor, excess_m

WATCHED_S = 12.0
STANDS_S = 2.0
"""In which a robot stands whose last commander has died."""
SLACK_M, SLACK_RAD = 0.003, 0.01
"""What noise of the cameras, and the motion within their latency, make of a pose."""


class Blow(NamedTuple):
    """Something that goes wrong at a time (s)."""

    at_s: float
    what: str
    strike: object


def faults():
    def fault(kind, wheel, duration_s, jump_s, loss):
        details = FAULT_KINDS[kind].details
        given_details = {"wheel": wheel, "jump_s": jump_s, "loss": loss}
        own = {name: value for name, value in given_details.items() if name in details}
        return Fault(kind=kind, duration_s=duration_s, **own)

    return st.builds(
        fault,
        st.sampled_from(list(FAULT_KINDS)),
        st.sampled_from(["both", "left", "right"]),
        st.sampled_from([0.05, 0.3, 1.0, 3.0, math.inf]),
        st.sampled_from([-10.0, -0.3, 0.2, 2.0, 3600.0]),
        st.sampled_from([0.3, 0.8]),
    )


def strikes():
    named = [("estop", estop), ("second commander", second_commander)]
    named += [(f"kill {node}", kill(node)) for node in ("controller", "onboard", "logger")]
    goals = st.builds(Pose, st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(-3, 3))
    return st.one_of(
        faults().map(lambda fault: (str(fault), Inject(fault))),
        faults().map(lambda fault: (str(fault), Inject(fault))),
        st.sampled_from(named),
        goals.map(lambda goal: (f"goal {goal}", send_to(goal))),
    )


BLOWS = st.lists(
    st.builds(
        lambda at_s, named: Blow(at_s, *named),
        st.floats(0.4, 8.0).map(lambda s: round(s, 2)),
        strikes(),
    ),
    min_size=1,
    max_size=4,
).map(lambda blows: sorted(blows, key=lambda blow: blow.at_s))
ROBOT = pytest.mark.parametrize("robot", [robot.name for robot in ROBOTS])


def play(config, activity, wrong, blows):
    """Return the stage after a drive with what is wrong from the start and what happens in it."""
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(config, activity, Path(folder) / "session.lcm", wrong)
        died_us = {}
        try:
            for blow in blows:
                stage.run(max(0.0, blow.at_s - stage.lab.now_us * 1e-6))
                blow.strike(stage)
                if blow.what.startswith("kill"):
                    died_us[blow.what] = stage.lab.now_us
            stage.run(WATCHED_S - stage.lab.now_us * 1e-6)
        finally:
            stage.close()
    return stage, died_us


def judge(stage, died_us, commander, blows):
    config, sights = stage.config, stage.witness.sights
    floor = Floor(config)
    # Nothing leaves the floor by more than its braking distance.
    fastest = max(abs(sight.v_m_per_s) for sight in sights)
    beyond = max(excess_m(config.floor, sight.x1_m, sight.x2_m) for sight in sights)
    assert beyond <= floor.braking_m(fastest)
    taken = any(blow.what == "second commander" for blow in blows)
    # Without a commander nothing moves for long.
    fatal = ("kill onboard",) if taken else (f"kill {commander}", "kill onboard")
    deaths = [us for what, us in died_us.items() if what in fatal]
    if deaths:
        late = [s for s in sights if s.utime >= min(deaths) + STANDS_S * 1e6]
        assert all(map(is_at_rest, late))
    # What is said to be parked is, and stays so unless another commander takes it.
    if commander == "controller" and stage.message == "parked":
        said = [s for s in sights if s.utime <= stage.ended_us][-1]
        for sight in [said] if taken else [said, sights[-1]]:
            assert_parked(stage, sight)


def assert_parked(stage, sight):
    config = stage.config
    marker = config.simulation.cameras.marker_offset
    goal = stage.commander.controller.goal
    true = relative_to(goal, Pose(sight.x1_m, sight.x2_m, sight.theta_rad))
    largest_x1, largest_x2 = config.controller.parked_position_m
    reach = math.hypot(*marker[:2]) + SLACK_M
    assert abs(true.x1) <= largest_x1 + reach
    assert abs(true.x2) <= largest_x2 + reach
    assert abs(true.theta) <= config.controller.parked_angle_rad + abs(marker[2]) + SLACK_RAD


@ROBOT
@settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow])
@example(preset="lab", seed=0, wrong=[], blows=[Blow(1.0, "second commander", second_commander)])
@given(
    preset=st.sampled_from(["lab", "harsh"]),
    seed=st.integers(0, 1000),
    wrong=st.lists(faults(), max_size=2),
    blows=BLOWS,
)
def test_a_park_under_random_faults_keeps_the_robot_on_the_floor(robot, preset, seed, wrong, blows):
    config = load_config(
        robot=robot, preset=preset, overrides=[f"seed={seed}", "controller.horizon=30"]
    )
    note(f"wrong {wrong}, then {[(blow.at_s, blow.what) for blow in blows]}")
    stage, died_us = play(config, "park", wrong, blows)
    judge(stage, died_us, "controller", blows)


@ROBOT
@settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 1000), wrong=st.lists(faults(), max_size=2), blows=BLOWS)
def test_a_calibration_under_random_faults_keeps_the_robot_on_the_floor(robot, seed, wrong, blows):
    config = load_config(robot=robot, overrides=[f"seed={seed}"])
    blows = [blow for blow in blows if "goal" not in blow.what and "second" not in blow.what]
    blows = [
        Blow(b.at_s, "kill sampler", kill("sampler")) if b.what == "kill controller" else b
        for b in blows
    ]
    note(f"wrong {wrong}, then {[(blow.at_s, blow.what) for blow in blows]}")
    stage, died_us = play(config, "calibrate", wrong, blows)
    judge(stage, died_us, "sampler", blows)
