"""Which models and runs can be measured together."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.config.load import load_config
from koopman_lab.data.reference_trajectories import ReferenceRuns
from koopman_lab.errors import DataError, ModelError
from koopman_lab.evaluation.validation import validate
from koopman_lab.koopman.trainer import train

RUNS = ReferenceRuns(
    Path("runs/a.lcm"), load_config(robot="dynamic"), "square", 40, 0, np.zeros(5), lambda _: []
)


def test_a_model_of_another_robot_is_refused_by_name():
    model, _ = train(ideal_dataset("kinematic"), "D5t")
    with pytest.raises(ModelError, match=r"a\.lcm: runs of the dynamic robot, .* mine \(D5t\)"):
        list(validate({"mine": model}, RUNS, 5))


def test_models_of_different_sampling_times_are_refused():
    model, _ = train(ideal_dataset("dynamic"), "D8Eul")
    slower = dataclasses.replace(model, dt_s=0.1)
    with pytest.raises(DataError, match=r"a 0\.05 s, b 0\.1 s\) take different steps"):
        list(validate({"a": model, "b": slower}, RUNS, 5))
