"""The controller as a state machine, walked through every state on the nominal equations."""

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import UsageError
from koopman_lab.geometry.planar import Pose, Velocity, compose, relative_to
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.receding_horizon import RecedingHorizon
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import Plan, make_solver
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import robot_type
from offboard.controller.controller import Controller
from offboard.controller.controller_step import Inputs, State
from offboard.desk.interlock import Interlock
from offboard.desk.measurements import Frame, WheelSpeeds

ORIGIN = Pose(0.0, 0.0, 0.0)
NEAR = Pose(-0.15, 0.02, 0.1)
SHORT = ("controller.horizon=25",)
STEP_US = 50_000
SILENT = Interlock("onboard loop silent")
STOPPED = Interlock("onboard loop stopped: emergency stop", lasting=True)


class FailingSolver:
    """Fails in the steps it is told to, counted from 1."""

    description = "fails as told"

    def __init__(self, solver, fails):
        self.solver, self.fails, self.step = solver, fails, 0

    def solve(self, x0, guess):
        if self.step in self.fails:
            return Plan(guess, np.tile(x0, (len(guess) + 1, 1)), np.nan, 7, False, "failed")
        return self.solver.solve(x0, guess)


class Bench:
    """The nominal robot, perfect cameras and wheels, and the controller, on their own clock."""

    def __init__(self, robot, start, overrides=SHORT, goal=ORIGIN, fails=()):
        config = load_config(robot=robot, overrides=overrides)
        settings = config.controller
        prediction = NominalPrediction(robot, settings.dt_s)
        cost, horizon = stage_cost(settings, prediction.robot), settings.horizon
        solver = make_solver(prediction, cost, horizon, settings.u_max)
        rollout = Rollout(prediction, cost, horizon)
        self.solver = FailingSolver(solver, fails)
        optimiser = RecedingHorizon(self.solver, rollout, settings.u_max, settings.dt_s)
        self.model, self.settings, self.goal = robot_type(robot), settings, goal
        self.controller = Controller(config, optimiser, goal)
        self.x = np.array([*compose(goal, start), 0.0, 0.0][: self.model.state_dim])
        self.now_us = 1_000_000
        self.speed = (0.0, 0.0)

    def step(self, *, tracked=True, wheels=True, onboard=None, logger=True):
        """Let one sampling interval pass; return what the controller put out at its start."""
        self.solver.step += 1
        frames = (Frame(self.now_us, Pose(*self.x[:3]), tracked),)
        if len(self.x) == 5:
            self.speed = self.x[3:]
        odometry = WheelSpeeds(self.now_us, Velocity(*self.speed)) if wheels else None
        interlock = onboard or (None if logger else Interlock("logger silent"))
        outputs = self.controller.step(Inputs(frames, odometry, interlock), self.now_us)
        self.x = self.model.step(self.x, np.array(outputs.u), self.settings.dt_s)
        if not outputs.holds:
            self.x[3:] = 0.0  # by the motor loop
        self.now_us += STEP_US
        return outputs

    def run(self, steps=400, **conditions):
        """Step until finished; return all outputs."""
        outputs = []
        while len(outputs) < steps:
            outputs.append(self.step(**conditions))
            if outputs[-1].finished:
                break
        return outputs


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_it_parks_holds_and_finishes_at_rest(robot):
    bench = Bench(robot, NEAR)
    outputs = bench.run()
    states = [o.state for o in outputs]
    assert states[0] is State.DRIVING
    assert states[-1] is State.PARKED
    assert states == sorted(states)
    assert [o.finished for o in outputs].count(True) == 1
    assert outputs[-1].finished
    hold_steps = round(bench.settings.parked_hold_s / bench.settings.dt_s)
    largest_x1, largest_x2 = bench.settings.parked_position_m
    driven = [o.state_in_goal_frame for o in outputs if o.state is State.DRIVING]
    for x in driven[-hold_steps:]:
        assert abs(x[0]) <= largest_x1
        assert abs(x[1]) <= largest_x2
        assert abs(x[2]) <= bench.settings.parked_angle_rad
        assert np.all(np.abs(x[3:4]) <= 0.01)
    assert bench.controller.duration_s(bench.now_us) == pytest.approx(len(driven) * 0.05)
    final = bench.controller.pose()
    assert abs(final.x1) <= largest_x1
    if robot == "kinematic":
        assert outputs[-1].u == (0.0, 0.0)


def test_while_driving_it_reports_the_plan():
    bench = Bench("kinematic", NEAR)
    outputs = bench.step()
    cost = stage_cost(bench.settings, bench.model)
    assert outputs.solved
    assert outputs.iterations > 0
    assert outputs.stage_cost == pytest.approx(cost(np.array(NEAR), np.array(outputs.u)))
    assert outputs.value >= outputs.stage_cost
    assert outputs.predicted.shape == (bench.settings.horizon + 1, 2)
    np.testing.assert_allclose(outputs.predicted[0], NEAR[:2])
    np.testing.assert_allclose(outputs.predicted[1], bench.x[:2], atol=1e-9)
    np.testing.assert_allclose(outputs.state_in_goal_frame, NEAR, atol=1e-15)
    assert outputs.pose_utime == bench.now_us - STEP_US


@pytest.mark.parametrize(
    ("missing", "reason"),
    [
        ({"onboard": SILENT}, "onboard"),
        ({"onboard": STOPPED}, "stopped"),
        ({"logger": False}, "logger"),
        ({"tracked": False}, "tracking"),
        ({"wheels": False}, "wheel"),
    ],
)
def test_it_waits_for_everything_it_needs(missing, reason):
    bench = Bench("dynamic", NEAR)
    waiting = bench.run(5, **missing)
    assert {o.state for o in waiting} == {State.WAIT}
    assert {o.u for o in waiting} == {(0.0, 0.0)}
    assert not any(o.finished for o in waiting)
    assert reason in bench.controller.reason
    assert bench.controller.duration_s(bench.now_us) == 0.0
    assert bench.step().state is State.DRIVING


def test_the_kinematic_robot_needs_no_wheels():
    assert Bench("kinematic", NEAR).step(wheels=False).state is State.DRIVING


def test_what_a_person_has_to_mend_ends_the_drive():
    bench = Bench("kinematic", NEAR)
    bench.run(3)
    failed = bench.step(onboard=STOPPED)
    assert failed.state is State.FAILED
    assert failed.u == (0.0, 0.0)
    assert bench.controller.reason == STOPPED.reason


@pytest.mark.parametrize("missing", [{"onboard": SILENT}, {"logger": False}, {"tracked": False}])
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_what_comes_back_lets_it_drive_on(robot, missing):
    bench = Bench(robot, NEAR)
    bench.run(6)
    outputs = bench.run(50, **missing)
    assert outputs[-1].state is State.PAUSED
    assert not outputs[-1].holds
    assert bench.run()[-1].state is State.PARKED
    (pause,) = bench.controller.pauses
    paused_steps = [o.state for o in outputs].count(State.PAUSED)
    assert pause.duration_s == pytest.approx(paused_steps * STEP_US * 1e-6)


def test_a_pause_counts_as_time():
    bench = Bench("kinematic", NEAR, (*SHORT, "controller.time_limit_s=2.0"))
    bench.run(3)
    assert bench.run(60, logger=False)[-1].state is State.TIME_LIMIT
    assert bench.controller.duration_s(bench.now_us) == pytest.approx(2.0)


def test_it_must_stay_parked_after_a_pause_as_long_as_ever():
    bench = Bench("kinematic", Pose(0.0, 0.0, 0.0))
    bench.run(8)
    bench.run(5, logger=False)
    outputs = bench.run()
    hold_steps = round(bench.settings.parked_hold_s / bench.settings.dt_s)
    assert [o.state for o in outputs].count(State.DRIVING) == hold_steps


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_time_limit_ends_the_drive_and_stops_the_robot(robot):
    bench = Bench(robot, Pose(-1.0, 0.5, 0.0), (*SHORT, "controller.time_limit_s=1.0"))
    outputs = bench.run()
    assert [o.state for o in outputs].count(State.DRIVING) == 20
    assert outputs[-1].state is State.TIME_LIMIT
    assert outputs[-1].finished
    assert not outputs[-1].holds


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_frame_lost_on_the_way_changes_nothing_on_the_nominal_robot(robot):
    undisturbed, disturbed = Bench(robot, NEAR), Bench(robot, NEAR)
    for k in range(12):
        expected, found = undisturbed.step(), disturbed.step(tracked=k not in (4, 8))
        np.testing.assert_allclose(found.u, expected.u, atol=1e-6)
        np.testing.assert_allclose(
            found.state_in_goal_frame, expected.state_in_goal_frame, atol=1e-6
        )


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_tracking_lost_for_long_ends_the_drive(robot):
    overrides = ("controller.tracking_timeout_s=0.1", "controller.pause_limit_s=1.0")
    bench = Bench(robot, NEAR, overrides)
    bench.run(6)
    outputs = bench.run(tracked=False)
    states = [o.state for o in outputs]
    # 0.1 s may pass: the frame of the step before is 50 ms old, then 100 ms, then too old.
    assert states[:2] == [State.DRIVING] * 2
    assert states[2:22] == [State.PAUSED] * 20
    assert set(states[22:]) == {State.FAILED}
    assert outputs[-1].finished
    assert bench.controller.reason == "tracking lost"
    assert not outputs[-1].holds


def test_a_blind_second_order_robot_is_left_to_the_watchdog_of_the_motor_loop():
    bench = Bench("dynamic", Pose(-1.0, 0.5, 0.0), (*SHORT, "controller.pause_limit_s=0.0"))
    bench.run(10)
    outputs = bench.run(wheels=False)
    assert outputs[-1].state is State.FAILED
    assert bench.controller.reason == "wheel odometry lost"
    assert outputs[-1].finished
    assert not outputs[-1].holds


def test_one_failure_of_the_solver_is_bridged_by_the_plan():
    bench = Bench("kinematic", NEAR, fails={4})
    outputs = bench.run(3)
    planned = outputs[-1].predicted[2]
    bridged = bench.step()
    assert not bridged.solved
    assert bridged.state is State.DRIVING
    np.testing.assert_allclose(bench.x[:2], planned, atol=1e-9)
    assert bench.run()[-1].state is State.PARKED


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_solver_that_keeps_failing_ends_the_drive(robot):
    bench = Bench(robot, Pose(-1.0, 0.5, 0.0), fails=set(range(8, 1000)))
    outputs = bench.run()
    assert [o.state for o in outputs].count(State.DRIVING) == 7 + 4
    assert outputs[-1].state is State.FAILED
    assert outputs[-1].finished
    assert "5 times" in bench.controller.reason
    assert not outputs[-1].holds


def test_the_end_is_reported_even_if_the_wheels_never_stop():
    bench = Bench("kinematic", NEAR, (*SHORT, "controller.time_limit_s=0.1"))
    bench.speed = (0.2, 0.0)
    outputs = bench.run()
    stopping = [o for o in outputs if o.state is State.TIME_LIMIT]
    assert outputs[-1].finished
    assert len(stopping) == pytest.approx(2.0 / 0.05, abs=1)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_goal_moved_on_the_way_is_where_it_parks(robot):
    bench, there = Bench(robot, NEAR), Pose(0.1, -0.02, 0.2)
    bench.run(6)
    bench.controller.move_goal(there, bench.now_us)
    assert bench.step().state is State.DRIVING
    assert bench.run()[-1].state is State.PARKED
    final = relative_to(there, Pose(*bench.x[:3]))
    assert bench.controller.goal == there
    assert abs(final.x1) <= bench.settings.parked_position_m[0]
    assert abs(final.x2) <= bench.settings.parked_position_m[1]
    assert bench.controller.pose() == pytest.approx(final, abs=1e-3)


def test_a_moved_goal_has_the_whole_time_limit_before_it():
    bench = Bench("kinematic", Pose(-1.0, 0.5, 0.0), (*SHORT, "controller.time_limit_s=1.0"))
    bench.run(10)
    bench.controller.move_goal(Pose(0.5, 0.0, 0.0), bench.now_us)
    assert [o.state for o in bench.run()].count(State.DRIVING) == 20


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (Pose(30.0, 0.0, 0.0), "x1 = 30 m is outside .*floor.x1_m"),
        (Pose(0.0, -3.0, 0.0), "x2 = -3 m is outside .*floor.x2_m"),
        (Pose(0.0, float("nan"), 0.0), "three numbers"),
    ],
)
def test_a_goal_off_the_floor_is_refused_and_the_old_one_stays(goal, said):
    bench = Bench("kinematic", NEAR)
    with pytest.raises(UsageError, match=said):
        bench.controller.move_goal(goal, 0)
    assert bench.controller.goal == ORIGIN
    with pytest.raises(UsageError, match=said):
        Bench("kinematic", NEAR, goal=goal)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("goal", [Pose(0.7, -1.3, 2.5), Pose(-0.2, 0.4, -3.1)])
def test_another_goal_gives_the_inputs_of_the_transformed_start(robot, goal):
    at_origin, elsewhere = Bench(robot, NEAR), Bench(robot, NEAR, goal=goal)
    for _ in range(15):
        expected, found = at_origin.step(), elsewhere.step()
        np.testing.assert_allclose(found.u, expected.u, atol=1e-5)
        moved = [compose(goal, Pose(x1, x2, 0.0))[:2] for x1, x2 in expected.predicted]
        np.testing.assert_allclose(found.predicted, moved, atol=1e-5)
    pose = Pose(*elsewhere.x[:3])
    np.testing.assert_allclose(relative_to(goal, pose), at_origin.x[:3], atol=1e-5)
