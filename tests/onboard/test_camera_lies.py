"""What the cameras say when they lie, frame by frame against what they would have said."""

import math
from itertools import chain, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests_support import DutyScript, Eye, lab_of

from koopman_lab.bus import channels
from koopman_lab.bus.hardware import driver, mocap
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.emulation.faults import KINDS, fault_message
from koopman_lab.geometry.planar import wrap_angle
from onboard.plant.cameras.lies import LIES, OTHER_BODY, Lies
from onboard.plant.node import PlantNode

CAMERA_KINDS = (*LIES, "sequence_stuck")
BEGINS_S, ENDS_S, UNTIL_S = 0.5, 6.5, 7.5
BEGINS_US, ENDS_US = round(BEGINS_S * 1e6), round(ENDS_S * 1e6)
JUMP_S = 30.0


def run(*faults, seconds=UNTIL_S, overrides=()):
    """Drive a curve with the plant's own cameras; return what they say."""
    planned = ", ".join(f"{{{fault}}}" for fault in faults)
    config = load_config(
        overrides=[
            f"simulation.faults=[{planned}]",
            "simulation.cameras.lost_frame_share=0.05",
            *overrides,
        ]
    )
    eye = Eye()
    lab = lab_of(config, PlantNode(config), DutyScript((0.3, 0.36)), eye)
    lab.run(seconds)
    return eye


@pytest.fixture(scope="module")
def truthful():
    """Return what cameras say that do not lie: rows of (utime, x1, x2, theta, valid)."""
    return rows(run())


def rows(eye):
    return [(f.utime, f.x1_m, f.x2_m, f.theta_rad, f.tracking_valid) for f in eye.frames]


def lied(kind, seconds=UNTIL_S):
    jump = f", jump_s: {JUMP_S}" if kind == "camera_clock" else ""
    return run(
        f"kind: {kind}, at_s: {BEGINS_S}, duration_s: {ENDS_S - BEGINS_S}{jump}", seconds=seconds
    )


def is_lie_time(row):
    return BEGINS_US <= row[0] < ENDS_US


POSES = {
    "heading_backwards": lambda x1, x2, theta: (x1, x2, theta + math.pi),
    "heading_turned": lambda x1, x2, theta: (x1, x2, theta + math.pi / 2),
    "heading_negated": lambda x1, x2, theta: (x1, x2, -theta),
    "x2_mirrored": lambda x1, x2, theta: (x1, -x2, theta),
    "frame_mirrored": lambda x1, x2, theta: (x1, -x2, -theta),
    "axes_exchanged": lambda x1, x2, theta: (x2, x1, theta),
    "frame_turned": lambda x1, x2, theta: (-x2, x1, theta),
    "camera_unit": lambda x1, x2, theta: (1000 * x1, 1000 * x2, theta),
}
"""Of what the cameras see, in words of the table of kinds."""


@pytest.mark.parametrize("kind", POSES)
def test_a_wrong_frame_body_or_unit_changes_every_pose_and_nothing_else(kind, truthful):
    told = rows(lied(kind))
    assert len(told) == len(truthful)
    for (utime, *pose, valid), seen in zip(told, truthful, strict=True):
        assert (utime, valid) == (seen[0], seen[4])
        if valid and is_lie_time(seen):
            x1, x2, theta = POSES[kind](*seen[1:4])
            assert pose == pytest.approx([x1, x2, wrap_angle(theta)], abs=1e-12, rel=1e-12)
            assert -math.pi < pose[2] <= math.pi
        else:
            assert tuple(pose) == seen[1:4], "what is not seen, or not lied about, is as ever"


def test_a_frozen_tracking_repeats_the_last_pose_of_before_with_new_stamps(truthful):
    told = rows(lied("tracking_frozen"))
    last = [seen for seen in truthful if seen[0] < BEGINS_US and seen[4]][-1]
    for row, seen in zip(told, truthful, strict=True):
        assert row == ((seen[0], *last[1:4], True) if is_lie_time(seen) else seen)


def bursts(told, truthful):
    """Return the times (s) since the fault began at which frames differ, in runs of frames."""
    differ = [
        k
        for k, (row, seen) in enumerate(zip(told, truthful, strict=True))
        if row[1:] != seen[1:] and is_lie_time(seen)
    ]
    assert all(
        row == seen for row, seen in zip(told, truthful, strict=True) if not is_lie_time(seen)
    )
    assert differ
    return differ, [(truthful[k][0] - BEGINS_US) * 1e-6 for k in differ]


def test_a_flipped_tracking_turns_five_frames_every_three_seconds(truthful):
    told = rows(lied("tracking_flipped"))
    differ, since_s = bursts(told, truthful)
    for k in differ:
        turned = wrap_angle(told[k][3] - truthful[k][3])
        assert abs(turned) == pytest.approx(math.pi)
        assert told[k][1:3] == truthful[k][1:3]
    in_bursts = [sum(truthful[k][4] for k in range(n, n + 5)) for n in (differ[0], differ[-1] - 4)]
    assert len(differ) == sum(in_bursts), "all that was seen, in two bursts"
    assert {math.floor(s / 3.0) for s in since_s} == {0, 1}
    assert max(s % 3.0 for s in since_s) < 0.02 + 0.005


def test_a_zero_tracking_says_all_zeros_in_two_frames_every_five_seconds(truthful):
    told = rows(lied("tracking_zero"))
    differ, since_s = bursts(told, truthful)
    assert [told[k][1:] for k in differ] == [(0.0, 0.0, 0.0, True)] * 4
    assert [math.floor(s / 5.0) for s in since_s] == [0, 0, 1, 1]
    assert differ[1] == differ[0] + 1
    assert differ[3] == differ[2] + 1


def test_exchanged_bodies_show_a_standing_one_for_a_tenth_of_every_second_second(truthful):
    told = rows(lied("bodies_exchanged"))
    differ, since_s = bursts(told, truthful)
    assert len(differ) == 3 * 24
    assert {math.floor(s / 2.0) for s in since_s} == {0, 1, 2}
    poses = np.array([told[k][1:4] for k in differ])
    assert all(told[k][4] for k in differ), "another body is seen whether or not the robot is"
    assert poses == pytest.approx(np.tile(OTHER_BODY, (len(poses), 1)), abs=0.005)
    assert len(set(map(tuple, poses))) == len(poses), "no two measurements are the same"


def test_a_clock_of_the_cameras_is_ahead_as_long_as_it_lasts(truthful):
    told = rows(lied("camera_clock"))
    for row, seen in zip(told, truthful, strict=True):
        ahead_us = round(JUMP_S * 1e6) if is_lie_time(seen) else 0
        assert row == (seen[0] + ahead_us, *seen[1:])


def numbers(eye):
    return [frame.sequence for frame in eye.frames]


def test_slow_cameras_take_every_other_frame_and_number_what_they_take(truthful):
    eye = lied("camera_slow")
    lie_time = [seen for seen in truthful if is_lie_time(seen)]
    before = [seen for seen in truthful if seen[0] < BEGINS_US]
    after = [seen for seen in truthful if seen[0] >= ENDS_US]
    assert rows(eye) == [*before, *lie_time[::2], *after]
    assert numbers(eye) == list(range(len(eye.frames)))


def test_doubled_frames_come_twice_with_numbers_of_their_own(truthful):
    eye = lied("frames_doubled")
    twice = chain.from_iterable((seen, seen) if is_lie_time(seen) else (seen,) for seen in truthful)
    assert rows(eye) == list(twice)
    assert numbers(eye) == list(range(len(eye.frames)))


def test_a_stuck_sequence_stays_as_it_was_and_goes_on_where_it_would_be(truthful):
    eye = lied("sequence_stuck")
    assert rows(eye) == truthful
    last = max(k for k, seen in enumerate(truthful) if seen[0] < BEGINS_US)
    assert numbers(eye) == [last if is_lie_time(seen) else k for k, seen in enumerate(truthful)]


def test_every_lie_is_looked_at_here():
    looked_at = {*POSES, "tracking_frozen", "tracking_flipped", "tracking_zero"}
    looked_at |= {"bodies_exchanged", "camera_clock", "camera_slow", "frames_doubled"}
    assert looked_at | {"sequence_stuck"} == set(CAMERA_KINDS)


def test_lies_are_told_on_top_of_each_other(truthful):
    planned = (
        f"kind: {kind}, at_s: {BEGINS_S}"
        for kind in ("camera_unit", "frames_doubled", "heading_turned", "camera_slow")
    )
    eye = run(*planned, "kind: occlusion, at_s: 0.8, duration_s: 0.2", seconds=1.2)
    told = [row for row in rows(eye) if row[0] >= BEGINS_US]
    taken = [seen for seen in truthful if seen[0] >= BEGINS_US][::2]
    for row, seen in zip(told[::2], taken, strict=False):
        assert row[0] == seen[0]
        assert row[4] == (seen[4] and not 0.8e6 <= seen[0] < 1.0e6)
        if row[4]:
            x1, x2, theta = seen[1:4]
            assert row[1:4] == pytest.approx(
                (1e3 * x1, 1e3 * x2, wrap_angle(theta + math.pi / 2)), abs=1e-9
            )
    assert told[::2] == told[1::2]
    assert numbers(eye) == list(range(len(eye.frames)))


def test_a_covered_robot_is_still_seen_by_a_frozen_tracking(truthful):
    eye = run(
        *(f"kind: {kind}, at_s: 0.5" for kind in ("occlusion", "tracking_frozen")), seconds=1.0
    )
    frozen = [row for row in rows(eye) if is_lie_time(row)]
    last = [seen for seen in truthful if seen[0] < BEGINS_US and seen[4]][-1]
    assert {row[1:] for row in frozen} == {(*last[1:4], True)}


@given(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1)))
def test_the_axes_of_the_frame_reach_every_symmetry_of_the_square(pose):
    """With the heading told apart: all eight maps of positions, and both senses of turning."""
    maps = set()
    for subset in product((True, False), repeat=4):
        kinds = ("axes_exchanged", "frame_turned", "x2_mirrored", "heading_negated")
        planned = [
            PlannedFault(kind=kind, at_s=0.0)
            for kind, under_way in zip(kinds, subset, strict=True)
            if under_way
        ]
        seen = ((1.0, 0.0, 1.0), (0.0, 1.0, 1.0), pose)
        lies = Lies(planned, 0)
        *axes, told = (lies.told((0, p, True))[0][1] for p in seen)
        maps.add(tuple(axes))
        assert math.hypot(*told[:2]) == pytest.approx(math.hypot(*pose[:2]))
    assert len(maps) == 16


def test_cameras_in_a_process_of_their_own_lie_as_those_of_the_plant_do():
    config, eye = load_config(preset="ideal"), Eye()
    lab = Lockstep(config)
    for node in (driver("plant", config), mocap("plant", config), DutyScript((0.3, 0.3)), eye):
        lab.add(node)
    lab.run(0.5)
    for kind in ("heading_backwards", "frames_doubled"):
        lab.publish(channels.FAULT, fault_message(Fault(kind=kind, duration_s=0.2), lab.now_us))
    lab.run(0.5)
    backwards = [f.utime for f in eye.frames if abs(f.theta_rad) == pytest.approx(math.pi)]
    assert len(backwards) == pytest.approx(2 * 0.2 * 240, abs=2)
    assert backwards[::2] == backwards[1::2]
    assert backwards[0] >= 0.5e6
    assert backwards[-1] < 0.71e6


def test_a_fault_that_is_not_under_way_changes_no_byte():
    """Neither one that is to come, nor one that is over, nor that there are many of them."""

    def said(faults, orders=()):
        config = load_config(overrides=[f"simulation.faults=[{', '.join(faults)}]"])
        eye = Eye()
        lab = lab_of(config, PlantNode(config), DutyScript((0.3, 0.36)), eye)
        for order in orders:
            lab.publish(channels.FAULT, fault_message(order, lab.now_us))
        lab.run(2.0)
        return [m.encode() for m in (*eye.frames, *eye.encoders, *eye.truths)]

    nothing = said([])
    assert len(nothing) == pytest.approx(2 * (240 + 100 + 100), abs=5)
    assert said([f"{{kind: {kind}, at_s: 100}}" for kind in KINDS]) == nothing
    assert said([f"{{kind: {kind}, at_s: 0, duration_s: 0}}" for kind in KINDS]) == nothing
    assert said([], [Fault(kind=kind, duration_s=0.0) for kind in KINDS]) == nothing
