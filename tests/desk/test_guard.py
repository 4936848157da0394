"""The guard: what contradicts itself stops the robot in time, what only is bad does not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_robot import LIES, STANDS, STEP_US, WHEEL_LIES, drive, honest, noisy, random_speeds

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose, Velocity, compose
from koopman_lab.robots.table import ROBOTS
from offboard.desk.guard import Guard
from offboard.desk.interlock import Cause
from offboard.desk.measurements import Frame
from offboard.desk.motion_check import MARKER_M

WIDE = ["floor.x1_m=[-99,99]", "floor.x2_m=[-99,99]"]
CONFIG = load_config(robot="kinematic", overrides=WIDE)
ANGLES = st.floats(-math.pi, math.pi)
METRES = st.floats(-3, 3)


def first_interlock(guard, steps, *, commanded=True):
    """Return the interlock that ends a drive, and after how long (s); None, None if none does."""
    for k, (now_us, frames, wheels, velocity, _) in enumerate(steps):
        driving = k >= STANDS
        if not driving:
            began_us = now_us
        guard.see_wheels(wheels)
        if commanded:
            guard.see_setpoint(velocity, now_us)
        guard.see_frames(iter(frames[::-1]), now_us, driving=driving)
        interlock = guard.interlock(now_us, driving=driving)
        if driving and interlock is not None:
            return interlock, (now_us - began_us) * 1e-6
    return None, None


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    frame=st.builds(Pose, METRES, METRES, ANGLES),
    ahead=st.floats(-0.05, 0.05),
    left=st.floats(-0.05, 0.05),
    turn=st.floats(-0.15, 0.15),
    radius=st.floats(0.95, 1.05),
    slip=st.floats(-0.06, 0.06),
)
def test_no_place_of_the_frame_or_the_markers_and_no_slip_is_a_contradiction(
    seed, frame, ahead, left, turn, radius, slip
):
    rng = np.random.default_rng(seed)
    see_noisily = noisy(rng)
    velocity = Velocity(0.0, 0.0)

    def see(pose):
        # Rubber that slides sideways in a bend, by an angle like harsh's.
        drifts = Pose(pose.x1, pose.x2, pose.theta + slip * velocity.v * velocity.omega)
        return see_noisily(compose(compose(frame, drifts), Pose(ahead, left, turn)))

    def steps():
        nonlocal velocity
        speeds = random_speeds(rng, 600)
        for step in drive(speeds, see, lambda a, b: (radius * a, radius * b)):
            velocity = step[3]
            yield step

    guard = Guard(CONFIG, 0.1)
    assert first_interlock(guard, steps()) == (None, None)


STRAIGHT = [(0.2, 0.0)] * 40
BACK = [(-0.2, 0.0)] * 40
ARC = [(0.2, 0.6)] * 40
FAST_ARC = [(0.4, 1.2)] * 40
TURN = [(0.0, 1.0)] * 40
SEEN_BY = {
    "heading backwards": [STRAIGHT, BACK, ARC, FAST_ARC],
    "x2 mirrored": [STRAIGHT, BACK],
    "frame mirrored": [ARC, FAST_ARC, TURN],
    "axes exchanged": [ARC, FAST_ARC],
    "frame turned": [STRAIGHT, BACK],
    "heading turned": [STRAIGHT, BACK],
    "heading negated": [ARC, FAST_ARC, TURN],
    "in feet": [STRAIGHT, BACK, FAST_ARC],
    "another body that stands": [STRAIGHT, BACK, ARC, FAST_ARC, TURN],
    "left and right exchanged": [ARC, FAST_ARC, TURN],
    "both reversed": [STRAIGHT, BACK, ARC, FAST_ARC, TURN],
    "exchanged and reversed": [STRAIGHT, BACK, ARC, FAST_ARC],
    "counts a quarter": [STRAIGHT, BACK, FAST_ARC, TURN],
    "do not count": [STRAIGHT, BACK, ARC, FAST_ARC, TURN],
}
"""By which motions a lie shows; others look right with it."""
NAMED = {
    "heading backwards": "rigid body",
    "x2 mirrored": "axes",
    "frame mirrored": "handedness",
    "axes exchanged": "axes",
    "frame turned": "axes",
    "heading turned": "axes",
    "heading negated": "handedness",
    "in feet": "units",
    "another body that stands": "another body",
    "left and right exchanged": "exchanged",
    "both reversed": "reversed",
    "exchanged and reversed": "exchanged and reversed",
    "counts a quarter": "encoder_counts_per_rev",
    "do not count": "encoders",
}


@pytest.mark.parametrize("lever_m", [None, MARKER_M])
@pytest.mark.parametrize(
    ("lie", "speeds"), [(lie, speeds) for lie, many in SEEN_BY.items() for speeds in many]
)
def test_a_contradiction_stops_within_a_second_and_names_what_to_check(lie, speeds, lever_m):
    see, roll = LIES.get(lie, honest), WHEEL_LIES.get(lie, lambda left, right: (left, right))
    guard = Guard(CONFIG, 0.1, lever_m=lever_m)
    start = Pose(0.2, 0.1, 0.9)
    interlock, after_s = first_interlock(guard, drive(speeds, see, roll, start), commanded=False)
    assert after_s is not None, lie
    assert after_s <= 1.0
    assert interlock.lasting or interlock.cause is Cause.TRACKING
    assert NAMED[lie] in interlock.reason or "frozen" in interlock.reason


@pytest.mark.parametrize("wanted", ["motion of its own", "nothing moves"])
def test_wheels_that_do_not_what_was_commanded_stop_the_robot(wanted):
    guard = Guard(CONFIG, 0.1)
    speeds = [(-0.2, 0.0) if wanted == "motion of its own" else (0.0, 0.0)] * 80
    found = None
    steps = drive(speeds, noisy(np.random.default_rng(0)))
    for now_us, frames, wheels, _, _ in list(steps)[STANDS:]:
        guard.see_wheels(wheels)
        guard.see_setpoint(Velocity(0.2, 0.0), now_us)
        guard.see_frames(iter(frames), now_us, driving=True)
        interlock = guard.interlock(now_us, driving=True)
        found = found or (interlock if interlock and interlock.lasting else None)
    assert found is not None
    assert "commanded were" in found.reason


@pytest.mark.parametrize("lag_s", [0.05, 0.3, 1.0])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_wheels_that_lag_behind_follow(lag_s, seed):
    commanded = random_speeds(np.random.default_rng(seed), 400, a=1.0, alpha=4.0)
    speeds, present = [], np.zeros(2)
    for target in commanded:
        present = present + 0.05 / lag_s * (np.array(target) - present)
        speeds.append(tuple(present))
    guard = Guard(CONFIG, 0.1)
    standing = [(0.0, 0.0)] * STANDS
    steps = zip(drive(speeds), standing + commanded, strict=True)
    for k, ((now_us, frames, wheels, _, _), setpoint) in enumerate(steps):
        guard.see_wheels(wheels)
        guard.see_setpoint(Velocity(*setpoint), now_us)
        guard.see_frames(iter(frames), now_us, driving=True)
        assert guard.interlock(now_us, driving=True) is None or k < STANDS


def test_a_robot_that_is_not_driven_may_be_carried():
    guard = Guard(CONFIG, 0.1)
    for k in range(200):
        now_us = 1_000_000 + k * STEP_US
        pose = Pose(0.02 * k, -0.01 * k, 0.0) if k < 100 else Pose(30.0, 1.0, 2.0)
        guard.see_frames(iter([Frame(now_us, pose, True)]), now_us, driving=False)
        interlock = guard.interlock(now_us, driving=False)
        assert interlock is None or interlock.cause is Cause.TRACKING
        assert (interlock is not None) == (k < 6 or 102 <= k < 110)


def test_a_jump_that_lasts_ends_a_drive_and_one_that_does_not_is_passed_over():
    guard = Guard(CONFIG, 0.5)
    for now_us, frames, wheels, _, pose in drive([(0.2, 0.0)] * 60):
        k = (now_us - 1_000_000) // STEP_US
        guard.see_wheels(wheels)
        lying = 10 <= k < 13 or k >= 40
        seen = Pose(pose.x1, pose.x2, pose.theta + math.pi) if lying else pose
        frame = guard.see_frames(
            iter([f._replace(pose=seen) for f in frames]), now_us, driving=True
        )
        interlock = guard.interlock(now_us, driving=True)
        if lying:
            assert frame is None or interlock is not None
        if STANDS < k < 40:
            assert interlock is None
        if k >= 45:
            assert interlock.lasting
            assert "180 deg" in interlock.reason


@pytest.mark.parametrize("robot", [robot.name for robot in ROBOTS])
def test_every_robot_is_kept_on_the_floor(robot):
    guard = Guard(load_config(robot=robot), 0.5)
    for now_us in (1_000_000, 1_200_000, 1_400_000):
        frame = Frame(now_us, Pose(2.6, 0.0, 0.0), True)
        guard.see_frames(iter([frame]), now_us, driving=False)
    interlock = guard.interlock(now_us, driving=False)
    assert interlock.cause is Cause.FLOOR
    assert "floor.x1_m" in interlock.reason


@pytest.mark.parametrize("roll_share", [0.0, -1.0, 1.0])
@pytest.mark.parametrize("stale", [False, True])
def test_no_speed_of_the_wheels_hides_that_the_robot_leaves_the_floor(roll_share, stale):
    guard = Guard(load_config(robot="kinematic", overrides=["floor.x1_m=[-1,1]"]), 0.1)
    found = None
    start = Pose(0.5, 0.0, 0.0)
    for now_us, frames, wheels, _, pose in drive([(0.4, 0.0)] * 30, start=start):
        if not stale or now_us < 1_500_000:
            guard.see_wheels(wheels._replace(velocity=Velocity(roll_share * wheels.velocity.v, 0)))
        guard.see_frames(iter(frames), now_us, driving=False)
        interlock = guard.interlock(now_us, driving=False)
        if found is None and interlock is not None and interlock.cause is Cause.FLOOR:
            found = pose
    assert found is not None
    assert found.x1 < 1.0


WITHOUT_WHEELS = {
    "heading backwards": [STRAIGHT, BACK, FAST_ARC],
    "heading negated": [FAST_ARC, TURN],
    "frame mirrored": [FAST_ARC, TURN],
}
"""Slower turns lie within what the lag of motors and a tracked point beside the axle explain."""


@pytest.mark.parametrize(
    ("lie", "speeds"), [(lie, speeds) for lie, many in WITHOUT_WHEELS.items() for speeds in many]
)
def test_cameras_that_contradict_the_commands_are_found_while_no_wheels_speak(lie, speeds):
    guard = Guard(CONFIG, 0.1)
    reasons = set()
    for now_us, frames, _, velocity, _ in drive(speeds, LIES[lie]):
        guard.see_setpoint(velocity, now_us)
        guard.see_frames(iter(frames), now_us, driving=now_us > 1_400_000)
        interlock = guard.interlock(now_us, driving=now_us > 1_400_000)
        if interlock is not None and interlock.cause is Cause.MOTION:
            reasons.add(interlock.reason)
    assert any("as the cameras see it" in reason for reason in reasons)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_honest_cameras_alone_contradict_no_command(seed):
    rng = np.random.default_rng(seed)
    guard = Guard(CONFIG, 0.1)
    mounted = Pose(*rng.uniform(-0.05, 0.05, 2), 0.0)
    see_noisily = noisy(rng)
    steps = drive(random_speeds(rng, 400), lambda pose: see_noisily(compose(pose, mounted)))
    for k, (now_us, frames, _, velocity, _) in enumerate(steps):
        guard.see_setpoint(velocity, now_us)
        guard.see_frames(iter(frames), now_us, driving=k >= STANDS)
        assert guard.interlock(now_us, driving=k >= STANDS) is None or k < STANDS
