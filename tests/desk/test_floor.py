"""Whoever may drive on can stop inside."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.geometry.planar import Pose
from offboard.desk.floor import BY_HAND_M_PER_S, Floor, excess_m

CONFIG = load_config(robot="kinematic", overrides=["floor.x1_m=[-1,2]", "floor.x2_m=[-0.5,1]"])
POSES = st.builds(Pose, st.floats(-2, 3), st.floats(-2, 2), st.floats(-math.pi, math.pi))
SPEEDS = st.floats(-0.6, 0.6)


def braked(pose, v):
    """Return where a robot stands that goes on for the reaction time and then brakes evenly."""
    loop = CONFIG.motor_loop
    x1, x2, dt = pose.x1, pose.x2, 1e-3
    left_s = loop.watchdog_s + CONFIG.controller.dt_s
    while v:
        x1, x2 = x1 + dt * v * math.cos(pose.theta), x2 + dt * v * math.sin(pose.theta)
        left_s -= dt
        if left_s < 0.0:
            v = math.copysign(max(0.0, abs(v) - loop.limits.a_m_per_s2 * dt), v)
    return x1, x2


@given(POSES, SPEEDS)
def test_who_may_drive_on_stands_inside_after_braking(pose, v):
    if Floor(CONFIG).interlock(pose, v) is None:
        assert excess_m(CONFIG.floor, pose.x1, pose.x2) == 0.0
        assert excess_m(CONFIG.floor, *braked(pose, v)) <= 1e-3


@given(POSES, SPEEDS)
def test_who_is_stopped_would_leave_or_is_outside(pose, v):
    interlock = Floor(CONFIG).interlock(pose, v)
    if interlock is not None:
        assert interlock.lasting
        outside = excess_m(CONFIG.floor, pose.x1, pose.x2) > 0.0
        assert outside or excess_m(CONFIG.floor, *braked(pose, v)) >= 0.0
        assert ("outside" in interlock.reason) == outside


@given(POSES, SPEEDS)
def test_only_a_person_drives_back_in_and_slowly(pose, v):
    by_hand = Floor(CONFIG, by_hand=True).interlock(pose, v)
    if excess_m(CONFIG.floor, pose.x1, pose.x2) == 0.0:
        assert (by_hand is None) == (Floor(CONFIG).interlock(pose, v) is None)
    elif by_hand is None:
        assert abs(v) <= BY_HAND_M_PER_S
        after = pose.x1 + 1e-3 * v * math.cos(pose.theta), pose.x2 + 1e-3 * v * math.sin(pose.theta)
        before = excess_m(CONFIG.floor, pose.x1, pose.x2)
        assert excess_m(CONFIG.floor, *after) <= before + 1e-12


@pytest.mark.parametrize("far", [300.0, 3000.0])
def test_a_pose_in_another_unit_is_named(far):
    assert "another unit" in Floor(CONFIG).interlock(Pose(far, 0.0, 0.0), 0.0).reason
