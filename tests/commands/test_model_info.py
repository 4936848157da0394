"""`klab model info`: all that a model file holds, for people and for scripts."""

import json

import numpy as np
from klab import MODEL, klab_json, klab_ok

from koopman_lab.koopman.bilinear_model import BilinearModel
from offboard.commands.data.model_info import lines


def test_as_json_it_is_the_whole_metadata():
    facts, model = klab_json("model", "info", MODEL), BilinearModel.load(MODEL)
    assert (facts["robot"], facts["dictionary"], facts["dt_s"]) == ("kinematic", "D5t", 0.05)
    assert facts["format"] >= 1
    assert facts["observables"] == list(model.dictionary.names)
    assert np.array_equal(facts["basis_inputs"], model.basis_inputs)
    assert len(facts["sha256"]) == 64
    for name, value in model.metadata.items():
        assert facts[name] == json.loads(json.dumps(value))


def test_a_person_reads_what_it_was_learned_from():
    text = klab_ok("model", "info", MODEL)
    for said in ("dictionary: D5t", "condition: ", "data_hash: ", "numpy: ", "rank: 5"):
        assert said in text


def test_any_nesting_becomes_lines():
    nested = {"a": 1.23456789, "b": {"c": [1, 2.0], "d": {}}, "e": [{"f": None}, {"f": True}]}
    assert list(lines(nested)) == [
        *("a: 1.23457", "b:", "  c: 1, 2", "  d: none"),
        *("e:", "  0:", "    f: none", "  1:", "    f: yes"),
    ]
