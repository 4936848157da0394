"""Which models may drive which lab, and what they are warned of."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import pytest
from ideal_data import ideal_dataset
from klab import MODEL
from misregistration import back_in_time
from stranger_models import Gains

from koopman_lab.config.load import load_config
from koopman_lab.errors import ModelError
from koopman_lab.evaluation.fit_to_drive import STORED, require_fit_to_drive, with_verdict
from koopman_lab.evaluation.plausibility import Reason, Verdict, from_dict, together, verdict
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.trainer import train
from koopman_lab.robots.table import robot_type

LAB = load_config(robot="kinematic")
RIGHT = train(ideal_dataset("kinematic"), "D5t")[0]
WRONG = train(back_in_time(ideal_dataset("kinematic")), "D5t")[0]
GOOD = verdict([], {})


def of(level, text):
    return verdict([Reason(level, text)], {})


def test_a_right_model_drives_and_a_wrong_one_does_not():
    assert require_fit_to_drive(RIGHT, LAB).level == "good"
    assert require_fit_to_drive(BilinearModel.load(MODEL), LAB).level == "good"
    with pytest.raises(ModelError, match="must not drive a robot: unusable: the model does not"):
        require_fit_to_drive(WRONG, LAB)


def test_whoever_plans_with_the_nominal_equations_needs_no_right_model():
    nominal = load_config(robot="kinematic", overrides=["controller.predict=nominal"])
    assert require_fit_to_drive(WRONG, nominal).level == "good"


def of_geometry(**lengths):
    robot = {"wheel_radius_m": 0.03, "track_width_m": 0.2} | lengths
    return replace(RIGHT, metadata={"data": {"robot": robot}})


@pytest.mark.parametrize(
    ("lengths", "level"),
    [
        ({}, "good"),
        ({"track_width_m": 0.1}, None),
        ({"wheel_radius_m": 0.04}, None),
        ({"wheel_radius_m": 0.0301}, "weak"),
        ({"track_width_m": None}, "good"),
    ],
)
def test_a_model_of_another_geometry_is_refused(lengths, level):
    model = of_geometry(**lengths)
    if level is None:
        (name, value), *_ = lengths.items()
        with pytest.raises(ModelError, match=rf"{name} {value}, the lab says"):
            require_fit_to_drive(model, LAB)
    else:
        assert require_fit_to_drive(model, LAB).level == level


@pytest.mark.parametrize("data", [{}, {"robot": None}, {"robot": "R1"}])
def test_data_that_say_no_geometry_are_taken(data):
    assert require_fit_to_drive(replace(RIGHT, metadata={"data": data}), LAB).level == "good"


def test_what_was_wrong_with_its_data_is_a_warning_or_a_refusal():
    weak = with_verdict(RIGHT, GOOD, [{"session": of("weak", "flips"), "data": GOOD}])
    judged = require_fit_to_drive(weak, LAB)
    assert [reason.text for reason in judged.reasons] == ["its data: flips"]
    slow = with_verdict(RIGHT, GOOD, [{"session": of("unusable", "slow"), "data": GOOD}])
    assert require_fit_to_drive(slow, LAB).level == "weak"
    for model in (RIGHT, WRONG):
        wrong = with_verdict(model, GOOD, [{"data": GOOD}, {"data": of("unusable", "mirrored")}])
        with pytest.raises(ModelError, match="mirrored"):
            require_fit_to_drive(wrong, LAB)
    assert (
        require_fit_to_drive(
            with_verdict(RIGHT, GOOD, [{"session": of("good", "a remark"), "data": GOOD}]), LAB
        ).reasons
        == ()
    )


def test_a_model_keeps_its_verdicts_on_disk(tmp_path):
    judged = of("weak", "poor")
    with_verdict(RIGHT, judged, [{"data": GOOD}]).save(tmp_path / "model.npz")
    stored = BilinearModel.load(tmp_path / "model.npz").metadata[STORED]
    assert from_dict(stored["model"]) == judged
    assert from_dict(stored["sources"][0]["data"]) == GOOD


def test_a_model_of_another_package_keeps_them_if_it_can():
    gains = Gains(robot_type("kinematic"), 0.05, (1.0, 1.0))
    kept = with_verdict(gains, GOOD, [])
    assert kept.metadata[STORED]["model"]["level"] == "good"

    plain = SimpleNamespace(metadata={})
    assert with_verdict(plain, GOOD, []) is plain

    @dataclass
    class Derived:
        metadata: dict = field(default_factory=dict, init=False)

    derived = Derived()
    assert with_verdict(derived, GOOD, []) is derived


def test_a_verdict_is_as_bad_as_its_worst_reason():
    reasons = [Reason("weak", "b"), Reason("good", "c"), Reason("unusable", "a")]
    judged = verdict(reasons, {"n": 1})
    assert (judged.level, judged.usable) == ("unusable", False)
    assert [reason.text for reason in judged.reasons] == ["a", "b", "c"]
    assert judged.text == "unusable: a"
    both = together(one=verdict(reasons[:2], {"x": 1}), two=GOOD)
    assert (both.level, both.figures) == ("weak", {"one": {"x": 1}, "two": {}})
    assert GOOD.text == "good"
    assert isinstance(from_dict(both.as_dict()), Verdict)
    assert from_dict(both.as_dict()) == both
