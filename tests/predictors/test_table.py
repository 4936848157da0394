"""The table of predictors: whose a model file is, and models that are no bilinear EDMD."""

import json

import numpy as np
import pytest
import stranger_models
from ideal_data import ideal_dataset
from klab import MODEL, OLDER
from nominal_runs import run
from prediction_models import exact_d5t

from koopman_lab.config.load import load_config
from koopman_lab.data.reference_trajectories import ReferenceRuns
from koopman_lab.errors import ModelError
from koopman_lab.evaluation.heldout import errors
from koopman_lab.evaluation.validation import predictors, validate
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.model_file import read_model_file, write_model_file
from koopman_lab.koopman.training_report import Method
from koopman_lab.mpc.receding_horizon import receding_horizon
from koopman_lab.predictors.predictor import require_robot
from koopman_lab.predictors.table import (
    PREDICTORS,
    file_header,
    load_model,
    prediction,
    prediction_of,
    trainer_of,
)
from koopman_lab.robots.table import robot_type

OLDER_MODEL = OLDER / "model.npz"


@pytest.fixture
def gains():
    """Add a predictor that is another model altogether; give a model of it."""
    row = stranger_models.GAINS
    PREDICTORS.register(row.name, row)
    yield stranger_models.Gains(robot_type("kinematic"), 0.05, (1.0, 1.0))
    PREDICTORS.unregister(row.name)


def learn(name, kind="kinematic"):
    trainer = trainer_of(name, "D5t" if kind == "kinematic" else "D8Eul", Method())
    trainer.add(ideal_dataset(kind))
    return trainer.result()


@pytest.mark.usefixtures("gains")
@pytest.mark.parametrize("name", ["edmd", "gains"])
def test_every_predictor_learns_saves_reads_predicts_and_plans(name, tmp_path):
    """All that the controller and the evaluation ask for, against the exact robot."""
    model, report = learn(name)
    json.dumps(report.as_dict())
    model.save(tmp_path / "model.npz")
    back = load_model(tmp_path / "model.npz")
    assert (back.predictor, back.dt_s, back.robot.name) == (name, 0.05, "kinematic")
    rng = np.random.default_rng(0)
    x0, inputs = rng.normal(size=(4, 3)), rng.uniform(-0.3, 0.3, (4, 5, 2))
    predicted = back.predict(x0, inputs)
    assert np.array_equal(predicted, model.predict(x0, inputs))
    exact = [x0]
    for k in range(5):
        exact.append(back.robot.step(exact[-1], inputs[:, k], 0.05))
    np.testing.assert_allclose(predicted, np.stack(exact, axis=1), atol=5e-3)
    assert errors(back, ideal_dataset("kinematic", seed=1), 20).position_max_m < 0.02
    config = load_config(robot="kinematic")
    optimiser = receding_horizon(prediction_of(back, config.controller), config)
    x = np.array([0.1, 0.02, 0.0])
    np.testing.assert_allclose(
        optimiser.advance(x, np.array([0.1, 0.2])), back.predict(x, np.array([[0.1, 0.2]]))[1]
    )
    for _ in range(120):
        x = back.robot.step(x, optimiser.step(x).u, 0.05)
    assert abs(x[1]) < 0.01
    with pytest.raises(ModelError, match=r"model .* is of the kinematic robot, .* the dynamic"):
        require_robot(back, "dynamic")


def test_a_model_that_lifts_nothing_is_validated_once_beside_those_that_do(gains):
    models = {"mine": gains, "theirs": exact_d5t()}
    labels = [(p.label, p.reprojection) for p in predictors(models)]
    assert labels == [
        ("mine", None),
        ("theirs", True),
        ("theirs, no reprojection", False),
        ("nominal", None),
    ]
    runs = ReferenceRuns(
        *(MODEL, load_config(robot="kinematic"), "infinity", 1, 0, np.zeros(3)),
        lambda _: [run("kinematic")],
    )
    found = list(validate(models, runs, 3))
    assert [v.label for v in found] == [label for label, _ in labels]
    # It is the nominal equations here.
    assert found[0].errors == found[-1].errors


def test_a_model_that_lifts_nothing_has_no_reprojection_to_leave_out(gains):
    planned = prediction(gains)
    assert planned.propagates == "state"
    assert planned.without_reprojection() is planned
    config = load_config(robot="kinematic", overrides=["controller.reprojection=false"])
    assert receding_horizon(planned, config).step(np.array([0.1, 0.0, 0.0])).solved


def stored_header(path):
    with np.load(path) as file:
        return json.loads(bytes(file["header"]))


def test_a_file_that_names_no_predictor_is_of_the_bilinear_edmd(tmp_path):
    assert "predictor" not in stored_header(OLDER_MODEL)
    assert read_model_file(OLDER_MODEL).header == stored_header(OLDER_MODEL) | {"predictor": "edmd"}
    model = load_model(OLDER_MODEL)
    assert isinstance(model, BilinearModel)
    model.save(tmp_path / "again.npz")
    again = stored_header(tmp_path / "again.npz")
    assert again["predictor"] == "edmd"
    assert {key: again[key] for key in stored_header(OLDER_MODEL)} == stored_header(OLDER_MODEL) | {
        "format": 2
    }


def test_a_predictor_that_is_not_installed_is_named_with_its_package(gains, tmp_path):
    gains.save(tmp_path / "model.npz")
    header = {"robot": "kinematic", "dt_s": 0.05, "metadata": {}, "package": "klab-resnet"}
    write_model_file(tmp_path / "other.npz", header | {"predictor": "resnet"}, {})
    with pytest.raises(
        ModelError,
        match=r"other\.npz: a model of the predictor 'resnet', which is"
        r" not installed; install the package klab-resnet; known",
    ):
        load_model(tmp_path / "other.npz")
    PREDICTORS.unregister("gains")
    with pytest.raises(ModelError, match=r"predictor 'gains', which is not installed; known: edmd"):
        load_model(tmp_path / "model.npz")
    with pytest.raises(ModelError, match=r"a model of the predictor 'gains', not edmd"):
        BilinearModel.load(tmp_path / "model.npz")


@pytest.mark.parametrize("missing", ["robot", "dt_s", "metadata", "observables", "dictionary"])
def test_a_header_that_lacks_something_is_a_damaged_file(missing, tmp_path):
    _, header, arrays = read_model_file(MODEL)
    del header[missing]
    write_model_file(tmp_path / "model.npz", header, arrays)
    with pytest.raises(ModelError, match=r"model\.npz: damaged, or not a model"):
        load_model(tmp_path / "model.npz")


def test_our_own_models_name_no_package():
    assert file_header("edmd") == {"predictor": "edmd"}
