import json

import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.errors import ModelError
from koopman_lab.evaluation.describe import describe


def test_facts_are_those_of_the_arrays():
    dataset = ideal_dataset("dynamic", segments=6, steps=20)
    facts = json.loads(json.dumps(describe(dataset, "D8Eul")))
    assert (facts["robot"], facts["dt_s"], facts["window"]) == ("dynamic", 0.05, None)
    assert facts["data_hash"] == dataset.data_hash
    assert facts["pairs"] == 3 * 6 * 20
    for index, x in dataset.X.items():
        basis = facts["basis_inputs"][str(index)]
        assert (basis["pairs"], basis["segments"]) == (120, 6)
        assert basis["ranges"]["x1"] == [x[:, 0].min(), x[:, 0].max()]
        assert basis["ranges"]["omega"] == [x[:, 4].min(), x[:, 4].max()]
        outside = np.abs(dataset.Y[index][:, 2]) > np.pi
        assert basis["angles_continued"] == outside.sum()
        assert basis["excitation"]["rank"] == 8


def test_a_set_too_small_to_train_with_is_described_all_the_same():
    dataset = ideal_dataset("kinematic", segments=1)
    dataset.X[2], dataset.Y[2] = dataset.X[2][:0], dataset.Y[2][:0]
    dataset.segments[2], dataset.start_us[2] = dataset.segments[2][:0], dataset.start_us[2][:0]
    facts = json.loads(json.dumps(describe(dataset, "D5t")))
    assert facts["basis_inputs"]["1"]["excitation"]["rank"] == 3
    assert facts["basis_inputs"]["2"]["ranges"]["theta"] is None
    assert facts["basis_inputs"]["2"]["excitation"]["condition"] is None


def test_a_dictionary_of_the_other_robot_is_refused():
    with pytest.raises(ModelError, match="D5t"):
        describe(ideal_dataset("kinematic"), "D8Eul")
