from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError, UsageError
from koopman_lab.geometry.planar import REST, Pose, Velocity, compose, move_along_arc
from offboard.desk.floor import excess_m
from offboard.desk.interlock import Cause, Interlock
from offboard.sampler.plan import Planner, contains
from offboard.sampler.profile import stopping_speed
from offboard.sampler.redraws import TEXTS, Redraw, Redraws, redraws_text
from offboard.sampler.sampler import ON_THE_WAY, Sampler
from offboard.sampler.sampler_step import Observation, Phase

DT_S = 0.05
SILENT = Interlock("onboard loop silent", cause=Cause.SILENCE)


class World:
    """The nominal robot, seen exactly and at once."""

    def __init__(self, robot, *overrides):
        self.config = load_config(robot=robot, overrides=overrides)
        self.sampler = Sampler(self.config, Planner(self.config, np.random.default_rng(3)))
        self.pose, self.velocity, self.now_us = Pose(0.2, 0.1, 0.5), REST, 0
        self.tracked, self.interlock = True, None
        self.actions = []

    def step(self):
        seen = Observation(self.pose if self.tracked else None, self.velocity, self.interlock)
        action = self.sampler.step(seen, self.now_us)
        self.actions.append((action, self.pose, self.velocity))
        before = self.velocity
        if self.config.robot.kind == "kinematic":
            self.velocity = before = Velocity(*action.u)
        else:
            self.velocity = Velocity(
                before.v + action.u[0] * DT_S, before.omega + action.u[1] * DT_S
            )
        mean_v, mean_omega = np.mean([before, self.velocity], axis=0)
        moved = move_along_arc(Pose(0.0, 0.0, 0.0), mean_v * DT_S, mean_omega * DT_S)
        self.pose = compose(self.pose, moved)
        self.now_us += 50_000
        return action

    def run(self, until, limit=60_000):
        for _ in range(limit):
            if until(self.step()):
                return
        pytest.fail("the sampler did not get there")


def runs(world):
    segments = {}
    for action, pose, velocity in world.actions:
        if action.phase is Phase.BASIS:
            segments.setdefault(action.segment, []).append((action, pose, velocity))
    return segments


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_a_session_gives_the_wanted_segments_in_turn(robot):
    world = World(robot, "sampler.segments_per_basis=4")
    world.run(lambda a: a.phase is Phase.DONE)
    settings, inputs = world.config.sampler, world.config.sampler.indexed_inputs
    segments = runs(world)
    order = [rows[0][0].basis_index for rows in segments.values()]
    assert Counter(order) == dict.fromkeys(inputs, 4)
    assert order == list(inputs) * 4
    for rows in segments.values():
        assert settings.smallest_steps <= len(rows) <= settings.largest_steps
        for action, pose, velocity in rows:
            assert action.u == inputs[action.basis_index]
            if robot == "dynamic":
                assert contains(settings.admissible_set, pose, velocity)
    assert world.velocity == pytest.approx(REST, abs=1e-9)


def test_the_launch_reaches_the_drawn_velocity_with_admissible_accelerations():
    config = load_config(robot="dynamic")
    planner = Planner(config, np.random.default_rng(0))
    for _ in range(100):
        wanted = planner.draw().velocity
        launch = planner.launch(wanted)
        reached = np.multiply(launch.u, launch.steps * DT_S)
        assert tuple(reached) == pytest.approx(wanted, abs=1e-12)
        assert abs(launch.u[0]) <= config.sampler.acceleration_m_per_s2 * (1 + 1e-12)
        assert abs(launch.u[1]) <= config.sampler.turn_acceleration_rad_per_s2 * (1 + 1e-12)


@pytest.mark.parametrize("phase", [Phase.DRIVE, Phase.LAUNCH, Phase.BASIS, Phase.ROTATE_TO_TARGET])
def test_lost_tracking_brakes_and_the_session_goes_on_afterwards(phase):
    world = World("dynamic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is phase)
    world.tracked = False
    for _ in range(60):
        assert world.step().phase is Phase.BRAKE
    assert world.velocity == pytest.approx(REST, abs=1e-9)
    assert world.sampler.redraws.by_text()["tracking lost"] == 1
    world.tracked = True
    world.run(lambda a: a.phase is Phase.DONE)
    assert world.sampler.done == 3


def test_a_silent_logger_or_onboard_loop_brakes_and_the_session_goes_on_afterwards():
    world = World("kinematic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is Phase.BASIS)
    world.interlock = SILENT
    for _ in range(60):
        assert world.step().phase is Phase.BRAKE
    assert world.velocity == pytest.approx(REST, abs=1e-9)
    assert world.sampler.redraws.by_text() == {"onboard loop or logger silent": 1}
    world.interlock = None
    world.run(lambda a: a.phase is Phase.DONE)
    assert world.sampler.done == 2


LATE = "commands came too late"


@pytest.mark.parametrize("phase", [Phase.LAUNCH, Phase.BASIS])
@pytest.mark.parametrize(("missed", "kept"), [(1, True), (2, False), (9, False)])
def test_a_run_in_which_the_motor_loop_waited_in_vain_is_drawn_again(phase, missed, kept):
    """A sampler that a busy machine held up for longer than the watchdog waits."""
    world = World("dynamic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is phase)
    world.now_us += missed * 50_000
    action = world.step()
    assert (action.phase is Phase.BRAKE) == (not kept)
    assert world.sampler.redraws.by_text().get(LATE, 0) == (not kept)
    world.run(lambda a: a.phase is Phase.DONE)
    assert world.sampler.done == world.sampler.total


@pytest.mark.parametrize("phase", [Phase.ROTATE_TO_TARGET, Phase.DRIVE, Phase.SETTLE])
def test_on_the_way_to_a_run_late_commands_cost_nothing(phase):
    world = World("kinematic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is phase)
    world.now_us += 9 * 50_000
    world.run(lambda a: a.phase is Phase.DONE)
    assert LATE not in world.sampler.redraws.by_text()


def test_nothing_moves_before_somebody_writes_it_down():
    world = World("kinematic")
    world.interlock = SILENT
    for _ in range(50):
        assert world.step().u == (0.0, 0.0)
    assert world.sampler.phase is Phase.WAIT


def test_a_robot_that_still_moves_after_lost_commands_is_brought_to_rest():
    world = World("dynamic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is Phase.BRAKE)
    world.velocity = Velocity(world.velocity.v + 0.05, world.velocity.omega - 0.2)
    world.run(lambda a: a.phase is Phase.ROTATE_TO_TARGET, limit=100)
    assert world.actions[-1][2] == pytest.approx(REST, abs=1e-9)


def test_impossible_sets_end_with_a_remedy():
    world = World("kinematic", "sampler.admissible_set.x1_m=[2.0, 2.1]")
    with pytest.raises(UsageError, match=r"lower sampler\.smallest_steps"):
        world.run(lambda a: a.phase is Phase.DONE)


@given(st.floats(-5, 5), st.floats(0.1, 5), st.floats(0, 0.5))
def test_stopping_speed_just_stops_in_the_distance(distance, acceleration, reaction_s):
    speed = stopping_speed(distance, acceleration, reaction_s)
    way = abs(speed) * reaction_s + speed**2 / (2 * acceleration)
    assert way == pytest.approx(abs(distance), abs=1e-9)
    assert speed * distance >= 0


@pytest.mark.parametrize("phase", ON_THE_WAY)
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_who_leaves_z_on_the_way_is_stopped_and_drawn_again(robot, phase):
    world = World(robot, "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is phase)
    world.pose = Pose(2.0, world.pose.x2, world.pose.theta)
    assert world.step().phase is Phase.BRAKE
    assert world.sampler.redraws.by_text()["left Z on the way"] == 1
    # From there it comes back.
    world.run(lambda a: a.phase is Phase.DONE)
    assert world.sampler.done == world.sampler.total


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_in_every_phase_that_drives_the_robot_stays_in_z_or_comes_back(robot):
    world = World(robot, "sampler.segments_per_basis=6")
    world.run(lambda a: a.phase is Phase.DONE)
    z = world.config.sampler.admissible_set
    outside = dict.fromkeys(Phase, 0.0)
    for action, pose, _ in world.actions:
        outside[action.phase] = max(outside[action.phase], excess_m(z, pose.x1, pose.x2))
    assert outside[Phase.BASIS] == 0.0
    if robot == "dynamic":  # whose launch is no standing start
        assert outside[Phase.LAUNCH] == 0.0
    assert max(outside.values()) < 0.2


WRONG = Interlock("cameras and wheels disagree", lasting=True, cause=Cause.MOTION)
OFF = Interlock("about to leave the floor", lasting=True, cause=Cause.FLOOR)
STOPPED = Interlock("onboard loop stopped: emergency stop", lasting=True, cause=Cause.HELD)
STREAM = Interlock("120 frames a second", cause=Cause.STREAM)
DRIVES = [phase for phase in Phase if phase not in (Phase.WAIT, Phase.BRAKE, Phase.DONE)]


@pytest.mark.parametrize("phase", DRIVES)
@pytest.mark.parametrize("interlock", [WRONG, OFF])
def test_what_has_to_be_mended_ends_the_session_in_words(phase, interlock):
    world = World("dynamic", "sampler.segments_per_basis=1")
    world.run(lambda a: a.phase is phase)
    world.interlock = interlock
    world.run(lambda a: a.phase is Phase.DONE, limit=100)
    assert world.sampler.reason == interlock.reason
    assert world.velocity == pytest.approx(REST, abs=1e-9)
    assert world.sampler.redraws.by_text() == {"stopped by what a person has to mend": 1}


@pytest.mark.parametrize("phase", [*DRIVES, Phase.BRAKE, Phase.WAIT])
@pytest.mark.parametrize("interlock", [SILENT, STOPPED, STREAM, WRONG, OFF])
def test_nothing_is_waited_for_longer_than_said(phase, interlock):
    # The kinematic robot has no launch.
    world = World("dynamic", "sampler.segments_per_basis=1", "sampler.wait_limit_s=5")
    if phase is Phase.WAIT:
        world.interlock = interlock
    world.run(lambda a: a.phase is phase)
    world.interlock = interlock
    began_us = world.now_us
    for _ in range(30):
        world.step()
    waits = world.sampler.waits_for
    assert world.sampler.reason or waits == interlock
    world.run(lambda a: a.phase is Phase.DONE, limit=160)
    assert interlock.reason in world.sampler.reason
    assert world.now_us - began_us < 8e6
    assert world.sampler.done < world.sampler.total


def test_the_limit_counts_anew_each_time():
    world = World("kinematic", "sampler.segments_per_basis=1", "sampler.wait_limit_s=5")
    for _ in range(5):
        world.interlock = SILENT
        for _ in range(90):
            world.step()
        world.interlock = None
        for _ in range(20):
            world.step()
    assert not world.sampler.reason


def test_draws_given_up_in_a_row_end_the_session_with_the_reason_and_what_to_do():
    world = World("kinematic", "sampler.largest_redraws_in_a_row=4")
    for _ in range(4):
        world.run(lambda a: a.phase is Phase.DRIVE)
        world.tracked = False
        world.run(lambda a: a.phase is Phase.BRAKE)
        world.tracked = True
    world.run(lambda a: a.phase is Phase.DONE, limit=100)
    assert "4 draws in a row" in world.sampler.reason
    assert "tracking lost" in world.sampler.reason
    assert "draw set" in world.sampler.reason


def test_a_complete_segment_makes_the_row_begin_anew():
    world = World("kinematic", "sampler.largest_redraws_in_a_row=3")
    for _ in range(4):
        for _ in range(2):
            world.run(lambda a: a.phase is Phase.DRIVE)
            world.tracked = False
            world.run(lambda a: a.phase is Phase.BRAKE)
            world.tracked = True
        done = world.sampler.done
        world.run(lambda _, done=done: world.sampler.done > done)
    assert not world.sampler.reason


@pytest.mark.parametrize("reason", list(Redraw))
def test_every_reason_has_words_and_a_place_in_the_message(reason):
    redraws = Redraws(1)
    redraws.add(reason)
    assert redraws.numbers()[reason] == 1
    assert sum(redraws.numbers()) == 1
    assert TEXTS[reason] in redraws_text(redraws.numbers())
    if reason not in (Redraw.DRAW_LEAVES_Z, Redraw.BEFORE_INTERRUPTION):
        assert TEXTS[reason] in redraws.too_many


@pytest.mark.parametrize("side", ["x1_m", "x2_m"])
@pytest.mark.parametrize("name", ["draw_set", "admissible_set"])
def test_sets_beyond_the_floor_are_refused(name, side):
    with pytest.raises(ConfigError, match=rf"sampler\.{name}\.{side}.*floor\.{side}"):
        World("kinematic", f"sampler.{name}.{side}=[-0.1, 2.6]")
