"""Observables that are no numbers are refused by name, before anything is fitted to them."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ideal_data import ideal_dataset

from koopman_lab.errors import DataError, ModelError
from koopman_lab.koopman.dictionary import DICTIONARIES, Dictionary
from koopman_lab.koopman.finite_observables import require_numbers_at_goal
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method

STATES = "1, x1, x2, theta, "


@pytest.fixture(scope="module")
def dataset():
    return ideal_dataset("kinematic", segments=6)


@pytest.mark.parametrize("method", [Method(), Method(ridge=1e-2)])
@pytest.mark.parametrize(
    ("expression", "is_none"),
    [
        ("sqrt(x2)", lambda x: x[:, 1] < 0.0),
        ("sqrt(0.1 - x1)", lambda x: x[:, 0] > 0.1),
        ("exp(1000*x1)", lambda x: 1000.0 * x[:, 0] > 100.0 * np.log(10.0)),
        ("(1e99*x1)^9", lambda x: np.abs(x[:, 0]) > 1e-80),
        ("sqrt(x2)/sqrt(x2)", lambda x: x[:, 1] <= 0.0),
    ],
)
def test_samples_without_a_number_are_counted(dataset, expression, is_none, method):
    none = np.concatenate(
        [is_none(dataset.X[index]) | is_none(dataset.Y[index]) for index in sorted(dataset.X)]
    )
    assert none.any()
    first = int(np.argmax(none))
    index, row = (1, first) if first < len(dataset.X[1]) else (2, first - len(dataset.X[1]))
    with pytest.raises(DataError) as refused:
        train(dataset, STATES + expression, method)
    said = str(refused.value)
    assert f"observable {expression!r} is no number" in said
    assert f"for {none.sum()} of {len(none)} samples" in said
    assert f"the first is sample {row} of basis input {index}, at x1 = " in said


@pytest.mark.parametrize(
    ("expression", "where"),
    [
        ("sin(theta)/theta", "at the goal"),
        ("1/x1", "at the goal"),
        ("1/(x1*x1 + x2*x2)", "at the goal"),
        ("sqrt(x2 + 2)/(x2 + 0.001)", "just beside the goal"),
    ],
)
def test_an_observable_must_be_a_number_where_the_robot_is_to_stand(dataset, expression, where):
    with pytest.raises(ModelError, match=rf"no number {where} \(x1 = .*choose another") as refused:
        train(dataset, STATES + expression)
    assert repr(expression) in str(refused.value)


def test_a_function_of_complex_values_is_refused_like_an_expression(dataset):
    like = DICTIONARIES["D5t"]
    custom = Dictionary(
        "Dcomplex",
        "kinematic",
        (*like.names, "root"),
        lambda x, m: [*like.observables(x, m), m.sqrt(x[1] + 0j)],
        like.state_rows,
        like.cosine_row,
        like.sine_row,
    )
    with pytest.raises(DataError, match="is no number"):
        train(dataset, custom)


@pytest.mark.parametrize("name", DICTIONARIES)
def test_the_papers_dictionaries_are_numbers_at_the_goal(name):
    require_numbers_at_goal(DICTIONARIES[name])


@given(st.integers(0, 59), st.sampled_from([1, 2]), st.sampled_from("XY"))
def test_one_sample_of_many_is_found_wherever_it_is(row, index, table):
    whole = ideal_dataset("kinematic", segments=2, steps=30)
    positive = {
        letter: {i: np.abs(x) + 0.1 for i, x in getattr(whole, letter).items()} for letter in "XY"
    }
    positive[table][index][row, 1] = -0.25
    with pytest.raises(
        DataError, match=rf"1 of 120 samples; .*sample {row} of basis input {index}"
    ):
        train(dataclasses.replace(whole, **positive), STATES + "sqrt(x2)")
