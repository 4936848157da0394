"""A model is judged by what it predicts, whatever it says of itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ideal_data import ideal_dataset
from klab import OLDER
from misregistration import back_in_time, exchanged_inputs, misregistered, noisy
from stranger_models import Gains

from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.robots.table import robot_type

KINDS = {"kinematic": "D5t", "dynamic": "D8Eul"}
DATA = {kind: ideal_dataset(kind, segments=16) for kind in KINDS}


def learned(dataset, dictionary=None, method=None):
    return train(dataset, dictionary or KINDS[dataset.robot_kind], method)[0]


@pytest.mark.parametrize(
    ("kind", "dictionary"),
    [("kinematic", "D5t"), *(("dynamic", name) for name in ("D8Eul", "D13t", "D12f"))],
)
@pytest.mark.parametrize("combination", ["paper", "generator"])
def test_a_model_of_right_data_is_good(kind, dictionary, combination):
    model = learned(noisy(DATA[kind]), dictionary, Method(combination=combination))
    judged = model_verdict(model)
    assert judged.level == "good", judged.text
    for motion in judged.figures["motion"]["inputs"].values():
        for share in (motion["moved"], motion["turned"], *motion["rates"].values()):
            assert share is None or share == pytest.approx(1.0, abs=0.15)


def test_the_reference_model_of_an_older_version_is_good():
    model = BilinearModel.load(OLDER / "model.npz")
    assert "verdict" not in model.metadata
    assert model_verdict(model).level == "good"


@pytest.mark.parametrize("noise", [False, True])
def test_a_dictionary_that_is_merely_poor_is_weak(noise):
    """Monomials of the angle know no heading well, but none of their signs is wrong."""
    data = noisy(DATA["dynamic"]) if noise else DATA["dynamic"]
    judged = model_verdict(learned(data, "D10m"))
    assert judged.level == "weak"
    assert "cosine and sine of the heading" in " ".join(r.text for r in judged.reasons)


def test_expressions_without_a_heading_are_weak():
    assert model_verdict(learned(DATA["kinematic"], "1, x1, x2, theta")).level == "weak"


WRONG = {
    "backwards": {"heading_rad": math.pi},
    "mirrored frame": {"mirrored": True, "clockwise": True},
    "mirrored axis": {"mirrored": True},
    "clockwise": {"clockwise": True},
    "axes exchanged": {"turned_rad": math.pi / 2, "mirrored": True, "heading_rad": -math.pi / 2},
    "quarter turn": {"heading_rad": math.pi / 2},
    "mm": {"scale": 1000.0},
    "quick": {"time_factor": 10.0},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wrong", WRONG)
def test_a_model_of_wrong_data_is_unusable(kind, wrong):
    """By its matrices alone: it keeps no word of its data."""
    model = learned(misregistered(DATA[kind], **WRONG[wrong]))
    assert model_verdict(replace(model, metadata={})).level == "unusable"


@pytest.mark.parametrize("kind", KINDS)
def test_exchanged_inputs_and_successors_are_unusable(kind):
    order = {i: i for i in DATA[kind].X} | {1: 2, 2: 1}
    for data in (exchanged_inputs(DATA[kind], order), back_in_time(DATA[kind])):
        judged = model_verdict(learned(data))
        assert judged.level == "unusable"
        assert "likely" in judged.text


@settings(max_examples=20)
@given(st.sampled_from(list(KINDS)), st.floats(-math.pi, math.pi), st.floats(-2.0, 2.0))
def test_a_model_of_a_frame_that_was_moved_is_good(kind, turned, moved):
    model = learned(misregistered(DATA[kind], turned, moved=(moved, -moved)))
    assert model_verdict(model).level == "good"


def test_a_known_cause_is_not_guessed_at():
    model = learned(misregistered(DATA["kinematic"], heading_rad=math.pi))
    assert "likely" not in model_verdict(model, cause_known=True).text


def test_a_model_that_predicts_no_numbers_is_unusable():
    model = learned(DATA["kinematic"])
    broken = replace(model, matrices=np.full_like(model.matrices, np.nan))
    judged = model_verdict(broken)
    assert judged.level == "unusable"
    assert judged.figures == {}


@pytest.mark.parametrize(
    ("gains", "level"),
    [
        ((1.0, 1.0), "good"),
        ((0.9, 1.1), "good"),
        ((0.6, 1.0), "weak"),
        ((1.0, 0.6), "weak"),
        ((-1.0, 1.0), "unusable"),
        ((1.0, -1.0), "unusable"),
        ((1.0, 0.1), "unusable"),
        ((5.0, 1.0), "unusable"),
    ],
)
def test_a_model_of_another_predictor_is_judged_alike(gains, level):
    """One that says no basis inputs and has no dictionary."""
    judged = model_verdict(Gains(robot_type("kinematic"), 0.05, gains))
    assert judged.level == level
    inputs = judged.figures["motion"]["inputs"]
    assert inputs["v"]["moved"] == pytest.approx(gains[0])
    assert inputs["omega"]["turned"] == pytest.approx(gains[1])


def test_sideways_motion_in_a_turn_is_weak():
    """The robot turns about a point 6 cm ahead of where it should."""
    data = DATA["kinematic"]

    def shifted(x):
        y = x.copy()
        y[:, 0] += 0.06 * np.cos(x[:, 2])
        y[:, 1] += 0.06 * np.sin(x[:, 2])
        return y

    tables = {name: {i: shifted(x) for i, x in getattr(data, name).items()} for name in ("X", "Y")}
    judged = model_verdict(learned(replace(data, **tables)))
    assert judged.level == "weak"
    assert "moves sideways by" in judged.text
