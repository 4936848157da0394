"""The driver of reference runs, walked through its phases by hand."""

import pytest

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose
from offboard.desk.interlock import TO_BE_MENDED, Cause, Interlock
from offboard.reference.reference_driver import Observation, Phase, ReferenceDriver

START = Pose(0.7, 0.1, -0.8)
INPUTS = [(0.2, 0.0), (0.0, 0.3), (-0.2, -0.3)]
DT_US = 50_000
SILENT = Interlock("onboard loop silent", cause=Cause.SILENCE)


class Robot:
    """Answers a driver as a plant and its motor loop would."""

    def __init__(self, runs=2):
        self.driver = ReferenceDriver(load_config(robot="dynamic"), START, INPUTS, runs)
        self.pose, self.now_us = Pose(0.0, 0.0, 0.0), 0
        self.interlock, self.holding, self.hands = None, False, True
        self.actions = []

    def tick(self):
        seen = Observation(self.pose, self.now_us, self.interlock, self.holding, not self.holding)
        action = self.driver.step(seen, self.now_us)
        if action.place and self.hands:
            self.pose = START
        if action.release or action.u is not None:
            self.holding = action.u is not None
        self.actions.append(action)
        self.now_us += DT_US
        return action

    def until(self, phase):
        for _ in range(400):
            if self.tick().phase is phase:
                return
        raise AssertionError(phase)


def test_each_run_drives_exactly_the_inputs_from_a_stand_at_the_start():
    robot = Robot()
    robot.until(Phase.DONE)
    phases = [action.phase for action in robot.actions]
    once = [Phase.PLACE, Phase.SETTLE, Phase.RUN, Phase.STOP]
    changes = [p for p, before in zip(phases, [None, *phases], strict=False) if p != before]
    assert changes == [*once, *once, Phase.DONE]
    for run in (0, 1):
        driven = [a for a in robot.actions if a.phase is Phase.RUN and a.run == run]
        assert [a.u for a in driven] == INPUTS
        assert [a.step for a in driven] == [0, 1, 2]
    settled = [a.u for a in robot.actions if a.phase is Phase.SETTLE]
    assert set(settled) == {(0.0, 0.0)}
    assert len(settled) == 2 * 20
    assert all(a.release for a in robot.actions if a.phase is Phase.STOP)
    assert (robot.driver.done, robot.driver.begun, robot.driver.repeated) == (2, 2, {})


def test_nothing_moves_before_all_are_ready():
    robot = Robot()
    robot.interlock = SILENT
    for _ in range(10):
        action = robot.tick()
        assert (action.phase, action.u, action.release, action.place) == (
            *(Phase.WAIT, None, False, False),
        )


def test_placing_is_asked_for_again_until_the_cameras_see_it():
    robot = Robot()
    robot.hands = False
    for _ in range(45):
        robot.tick()
    assert [k for k, a in enumerate(robot.actions) if a.place] == [0, 20, 40]
    assert {a.phase for a in robot.actions} == {Phase.PLACE}


@pytest.mark.parametrize("pose", [None, Pose(0.75, 0.1, -0.8), Pose(0.7, 0.1, -0.6)])
def test_a_robot_that_does_not_stand_at_the_start_is_placed_again(pose):
    robot = Robot()
    robot.until(Phase.SETTLE)
    robot.pose = pose
    assert robot.tick().phase is Phase.PLACE


def test_a_run_waits_until_the_motor_loop_obeys():
    robot = Robot()
    robot.until(Phase.SETTLE)
    for _ in range(100):
        robot.holding = False
        assert robot.tick().phase is Phase.SETTLE
    assert robot.tick().phase is Phase.RUN


@pytest.mark.parametrize("lost", [{"interlock": SILENT}, {"holding": False}])
def test_a_run_that_is_cut_off_is_driven_again(lost):
    robot = Robot(runs=1)
    robot.until(Phase.RUN)
    vars(robot).update(lost)
    assert robot.tick().phase is Phase.STOP
    robot.interlock = None
    robot.until(Phase.DONE)
    assert sum(robot.driver.repeated.values()) == 1
    assert [a.step for a in robot.actions if a.phase is Phase.RUN and a.run == 1] == [0, 1, 2]
    assert (robot.driver.done, robot.driver.begun) == (1, 2)


@pytest.mark.parametrize("cause", list(Cause))
@pytest.mark.parametrize("lasting", [False, True])
def test_only_what_must_be_mended_ends_the_session(cause, lasting):
    robot = Robot(runs=1)
    robot.until(Phase.RUN)
    robot.interlock = Interlock("a reason", lasting=lasting, cause=cause)
    robot.tick()
    robot.interlock = None
    robot.until(Phase.DONE)
    ended = cause in TO_BE_MENDED
    assert (robot.driver.done, robot.driver.reason) == ((0, "a reason") if ended else (1, ""))
