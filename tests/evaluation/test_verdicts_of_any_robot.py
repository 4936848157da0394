"""A kind of robot that the product does not know is judged by the equations of its description."""

import numpy as np
import pytest
from ideal_data import ideal_dataset
from misregistration import exchanged_inputs, misregistered, noisy
from omnidirectional import EXPRESSIONS, KIND, OMNIDIRECTIONAL
from synthetic_session import Session

from koopman_lab.data.dataset import DataSet
from koopman_lab.evaluation.data_verdict import data_verdict
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.evaluation.session_verdict import recorded_verdicts
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.robots.table import ROBOTS


@pytest.fixture(autouse=True)
def registered():
    ROBOTS.register(KIND, OMNIDIRECTIONAL)
    yield
    ROBOTS.unregister(KIND)


@pytest.fixture
def dataset():
    return ideal_dataset(KIND)


def test_data_and_model_are_judged_by_its_own_equations(dataset):
    """It drives sideways as it should, and no wheel is asked."""
    assert data_verdict(noisy(dataset)).level == "good"
    model = train(dataset, ", ".join(EXPRESSIONS), Method(combination="generator"))[0]
    judged = model_verdict(model)
    assert judged.level == "good"
    assert judged.figures["sideways_share_in_turn"] is None
    for name in ("ahead", "aside"):
        assert judged.figures["motion"]["inputs"][name]["moved"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("registration", "cause"),
    [
        ({"heading_rad": np.pi}, "axis points backwards"),
        ({"heading_rad": np.pi / 2}, "turned by 90 deg"),
        ({"mirrored": True}, "one axis counts the other way round"),
        ({"mirrored": True, "clockwise": True}, "the frame is mirrored"),
        ({"scale": 1000.0}, "positions are in mm"),
    ],
    ids=["backwards", "quarter", "axis", "frame", "mm"],
)
def test_a_wrong_frame_is_named(dataset, registration, cause):
    seen = misregistered(dataset, **registration)
    judged = data_verdict(seen)
    assert judged.level == "unusable"
    assert cause in judged.text
    assert model_verdict(train(seen, ", ".join(EXPRESSIONS))[0]).level == "unusable"


@pytest.mark.parametrize("order", [{1: 2, 2: 1, 3: 3}, {1: 3, 2: 1, 3: 2}])
def test_exchanged_inputs_are_named(dataset, order):
    judged = data_verdict(exchanged_inputs(dataset, order))
    assert judged.level == "unusable"
    moved = " and ".join(f"u_{i}" for i, j in order.items() if i != j)
    assert f"the inputs {moved} are exchanged" in judged.text


def test_a_recorded_session_is_judged_by_its_inputs_alone(tmp_path):
    """No motor loop of ours limits it, and its log holds no wheels."""
    session = Session(KIND, segments=6)
    verdicts = recorded_verdicts(DataSet.from_log(session.write(tmp_path / "session.lcm")))
    assert {name: v.level for name, v in verdicts.items()} == {"session": "good", "data": "good"}
    inside = [f for f in session.frames if f.x1_m < 50.0]
    for frame in inside[600:606]:
        frame.theta_rad = float(np.remainder(frame.theta_rad + 2 * np.pi, 2 * np.pi) - np.pi)
    dataset = DataSet.from_log(session.write(tmp_path / "flipped.lcm"))
    assert dataset.metadata["session"]["left_out"]["flipped"] == 6
    assert recorded_verdicts(dataset)["data"].level == "good"
