"""Whatever frame, axis, sign, unit or clock is wrong, the pairs alone give it away."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ideal_data import ideal_dataset
from misregistration import back_in_time, exchanged_inputs, misregistered, noisy

from koopman_lab.evaluation.data_verdict import data_verdict, excitation_reasons, excitations
from koopman_lab.evaluation.nominal_motion import motion_of_data
from koopman_lab.koopman.dictionary import dictionary

KINDS = ("kinematic", "dynamic")
D5T = dictionary("D5t", "kinematic")
DATA = {kind: ideal_dataset(kind) for kind in KINDS}
FACTORS = st.floats(-3.0, 3.0).map(lambda exponent: 10.0**exponent)
QUARTERS = st.sampled_from([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi])
ANGLES = st.floats(-math.pi, math.pi)


def is_off(factor):
    """Return whether a factor is one that no slip and no wheel makes."""
    return not 0.7 < factor < 1.4


@settings(max_examples=200)
@given(
    st.sampled_from(KINDS),
    st.one_of(QUARTERS, ANGLES),
    st.one_of(QUARTERS, ANGLES),
    st.one_of(st.just(1.0), FACTORS),
    st.one_of(st.just(1.0), FACTORS),
    st.booleans(),
    st.booleans(),
)
def test_every_wrong_registration_is_told(
    kind, turned, heading, scale, time_factor, mirrored, clockwise
):
    heading_is_off = abs(math.remainder(heading, math.tau)) > 0.3
    wrong = mirrored or clockwise or heading_is_off or is_off(scale) or is_off(time_factor)
    assume(wrong)
    seen = misregistered(
        DATA[kind], turned, heading, scale, time_factor, mirrored=mirrored, clockwise=clockwise
    )
    judged = data_verdict(seen)
    assert judged.level != "good"
    assert "contradict the basis inputs" in judged.text


@settings(max_examples=100)
@given(
    st.sampled_from(KINDS),
    ANGLES,
    st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
    st.floats(-0.05, 0.05),
    st.floats(0.95, 1.05),
    st.integers(0, 1000),
)
def test_every_planar_motion_of_the_frame_is_right(kind, turned, moved, heading, scale, seed):
    """Also with the noise of preset `harsh`, markers that are a little off and wheels that are."""
    seen = misregistered(noisy(DATA[kind], seed), turned, heading, scale, moved=moved)
    judged = data_verdict(seen)
    assert judged.level == "good", judged.text


@given(st.sampled_from(KINDS), ANGLES, st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)))
def test_no_planar_motion_changes_the_figures(kind, turned, moved):
    before = motion_of_data(DATA[kind]).inputs
    after = motion_of_data(misregistered(DATA[kind], turned, moved=moved)).inputs
    for name, motion in before.items():
        for key, value in vars(motion).items():
            assert vars(after[name])[key] == (
                value if value is None or isinstance(value, int) else pytest.approx(value, abs=1e-9)
            )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("registration", "cause"),
    [
        ({"heading_rad": math.pi}, "the tracked body's axis points backwards"),
        ({"mirrored": True, "clockwise": True}, "the frame is mirrored"),
        ({"mirrored": True}, "one axis counts the other way round"),
        ({"clockwise": True}, "the heading counts the other way round"),
        ({"turned_rad": math.pi / 2, "mirrored": True, "heading_rad": -math.pi / 2}, "x1 and x2"),
        ({"heading_rad": math.pi / 2}, "turned by 90 deg against each other"),
        ({"scale": 1000.0}, "positions are in mm"),
        ({"time_factor": 2.0}, "sampling time is 0.5 times"),
        ({"scale": 0.6}, "robot.wheel_radius_m"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_the_likely_cause_is_named(kind, registration, cause):
    judged = data_verdict(misregistered(DATA[kind], **registration))
    assert judged.level != "good"
    assert cause in judged.text


@pytest.mark.parametrize("kind", KINDS)
def test_exchanged_inputs_are_named(kind):
    order = {i: i for i in DATA[kind].X} | {1: 2, 2: 1}
    judged = data_verdict(exchanged_inputs(DATA[kind], order))
    assert judged.level == "unusable"
    assert "the inputs u_1 and u_2 are exchanged" in judged.text


@pytest.mark.parametrize("kind", KINDS)
def test_states_exchanged_with_successors_are_named(kind):
    judged = data_verdict(back_in_time(DATA[kind]))
    assert judged.level == "unusable"
    assert "X_i.dat and Y_i.dat are exchanged" in judged.text


def test_a_session_has_no_files_to_exchange():
    recorded = replace(back_in_time(DATA["kinematic"]), metadata={"runs": 10})
    assert "X_i.dat" not in data_verdict(recorded).text


def test_a_robot_that_stood_still_did_not_follow():
    still = replace(DATA["kinematic"], Y=DATA["kinematic"].X)
    judged = data_verdict(still)
    assert judged.level == "unusable"
    assert "did not follow its commands" in judged.text


def test_an_input_without_a_sample_is_named():
    tables = {
        name: dict(getattr(DATA["kinematic"], name)) for name in ("X", "Y", "segments", "start_us")
    }
    for table in tables.values():
        table[2] = table[2][:0]
    judged = data_verdict(replace(DATA["kinematic"], **tables))
    assert judged.level == "unusable"
    assert "no sample of u_2" in judged.text
    assert judged.figures["pairs"] == {"1": 320, "2": 0}


def test_nothing_at_all_is_unusable():
    nothing = {
        name: {i: x[:0] for i, x in getattr(DATA["kinematic"], name).items()}
        for name in ("X", "Y", "segments", "start_us")
    }
    judged = data_verdict(replace(DATA["kinematic"], **nothing))
    assert judged.level == "unusable"
    assert judged.figures["motion"] is None


def test_samples_that_do_not_span_a_dictionary_are_weak():
    short = ideal_dataset("kinematic", segments=1)
    judged = data_verdict(short, excitations(short, D5T), D5T)
    assert judged.level == "weak"
    assert "span only 3 of the 5 observables of D5t" in judged.text
    spans = excitations(short, D5T)
    (first, *_) = excitation_reasons(spans, D5T, regularised=True)
    assert first.text.endswith("observables of D5t; the ridge decides the rest")


def test_noise_larger_than_the_steps_is_named():
    slow = ideal_dataset("kinematic", dt_s=0.005)
    judged = data_verdict(noisy(slow))
    assert judged.level == "weak"
    assert "--dt" in judged.text


def test_the_figures_are_those_of_the_pairs():
    """Half of the way and a third of the turn, whatever the heading."""
    data = DATA["kinematic"]
    driven = {
        i: data.robot.step(x, data.basis_inputs[i] * [0.5, 1 / 3], 0.05) for i, x in data.X.items()
    }
    motion = motion_of_data(replace(data, Y=driven))
    assert motion.turn == pytest.approx(1 / 3)
    for of_input in motion.inputs.values():
        assert of_input.turned == pytest.approx(1 / 3)
        # The chord of a smaller turn is a little longer, and lies at another angle.
        assert of_input.moved == pytest.approx(0.5, abs=1e-3)
        assert of_input.pairs == 320


def test_what_an_input_should_leave_alone_is_seen():
    """Under u_1, which accelerates, the robot turns faster as well."""
    data = DATA["dynamic"]
    changed = {i: y.copy() for i, y in data.Y.items()}
    changed[1][:, 4] += 0.02
    judged = data_verdict(replace(data, Y=changed))
    assert judged.level == "unusable"
    assert "changed omega, which it leaves alone, by" in judged.text
    assert np.isclose(judged.figures["motion"]["inputs"]["u_1"]["uncalled"]["omega"], 0.8)
