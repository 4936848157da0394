"""Data sets and models as a person uses them in Python."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ideal_data import ideal_dataset
from prediction_models import exact_d5t

import koopman_lab as kl
from koopman_lab.errors import ArgumentError
from koopman_lab.koopman.trainer import train as fit
from koopman_lab.koopman.training_report import Method

EXACT = kl.Model(exact_d5t())
OWN = ("1", "x1", "x2", "theta", "cos(theta)", "sin(theta)")
LEADING = st.lists(st.integers(1, 3), max_size=2).map(tuple)


@pytest.fixture(scope="module")
def data():
    return ideal_dataset("kinematic", segments=20)


def test_what_is_saved_is_read_by_text_and_by_path(data, tmp_path):
    data.save(str(tmp_path / "pairs.npz"))
    model = kl.train(data)
    model.save(str(tmp_path / "model.npz"))
    for place in (tmp_path, str(tmp_path)):
        again = kl.read_data(f"{place}/pairs.npz")
        assert again.data_hash == data.data_hash
        read = kl.Model.load(f"{place}/model.npz")
        np.testing.assert_array_equal(read.learned.matrices, model.learned.matrices)
    assert kl.DataSet.load(tmp_path / "pairs.npz").data_hash == data.data_hash


def test_they_say_what_they_are(data):
    assert repr(data) == (
        "DataSet(kinematic robot, dt 0.05 s: 800 pairs under u_1 = (0.2, -0.4), "
        "800 pairs under u_2 = (0.2, 0.6))"
    )
    assert repr(kl.train(data)) == "Model(edmd D5t of the kinematic robot, dt 0.05 s, good)"


@pytest.mark.parametrize("dictionary", [OWN, list(OWN), ", ".join(OWN)])
def test_a_model_is_that_of_the_library_with_the_verdict_on_it(data, dictionary, tmp_path):
    data.save(tmp_path / "pairs.npz")
    expected, _ = fit(data, ", ".join(OWN), Method("plain", 1e-6))
    for source in (data, tmp_path / "pairs.npz", str(tmp_path / "pairs.npz")):
        model = kl.train(source, dictionary=dictionary, ridge=1e-6)
        np.testing.assert_array_equal(model.learned.matrices, expected.matrices)
        assert model.name == "D6own"
        assert model.verdict.level == "good"
        assert set(model.metadata["verdict"]) == {"model", "sources"}


def test_several_sources_are_one_model_and_none_is_refused(data):
    other = ideal_dataset("kinematic", segments=20, seed=1)
    expected, _ = fit([data, other], "D5t")
    both = kl.train(data, other).learned
    np.testing.assert_array_equal(both.matrices, expected.matrices)
    with pytest.raises(kl.LabError, match="nothing to train with"):
        kl.train()


def test_a_model_that_kept_no_verdict_is_judged_now():
    assert "verdict" not in EXACT.metadata
    assert EXACT.verdict.level == "good"


@given(LEADING, LEADING, st.integers(0, 3))
def test_predictions_broadcast_and_each_is_that_of_its_own_start(of_x, of_u, steps):
    rng = np.random.default_rng(0)
    x0, inputs = rng.normal(size=(*of_x, 3)), 0.3 * rng.normal(size=(*of_u, steps, 2))
    try:
        leading = np.broadcast_shapes(of_x, of_u)
    except ValueError:
        with pytest.raises(ArgumentError) as refused:
            EXACT.predict(x0, inputs)
        assert str(x0.shape) in str(refused.value)
        assert str(inputs.shape) in str(refused.value)
        return
    predicted = EXACT.predict(x0, inputs)
    assert predicted.shape == (*leading, steps + 1, 3)
    starts = np.broadcast_to(x0, (*leading, 3))
    held = np.broadcast_to(inputs, (*leading, steps, 2))
    for index in np.ndindex(*leading):
        x = starts[index]
        np.testing.assert_array_equal(predicted[index][0], x)
        for k in range(steps):
            x = EXACT.learned.step(x, held[index][k])
            np.testing.assert_allclose(predicted[index][k + 1], x, rtol=1e-12, atol=1e-12)


@given(st.lists(st.integers(0, 4), max_size=3).map(tuple))
def test_a_shape_that_is_none_is_refused_with_both_numbers(shape):
    inputs, x0 = np.zeros((2, 2)), np.zeros(3)
    if not shape or shape[-1] != 3:
        with pytest.raises(ArgumentError) as refused:
            EXACT.predict(np.zeros(shape), inputs)
        assert f"x0: shape {shape}, expected (..., 3)" in str(refused.value)
        assert "x1, x2, theta of the kinematic robot" in str(refused.value)
    if len(shape) < 2 or shape[-1] != 2:
        with pytest.raises(ArgumentError) as refused:
            EXACT.predict(x0, np.zeros(shape))
        assert f"inputs: shape {shape}, expected (..., H, 2)" in str(refused.value)


@pytest.mark.parametrize(
    ("x0", "said"),
    [
        ([0.0, math.nan, 0.0], r"x0: nan at \(1,\), expected finite numbers"),
        ([[0.0, 0.0, 0.0], [0.0, 0.0, math.inf]], r"x0: inf at \(1, 2\)"),
        (["left", "right", "back"], "x0: no array of numbers"),
        ([[0.0, 0.0], [0.0]], "x0: no array of numbers"),
        (None, "x0: "),
    ],
)
def test_what_is_no_finite_number_is_refused(x0, said):
    with pytest.raises(ArgumentError, match=said) as refused:
        EXACT.predict(x0, np.zeros((1, 2)))
    assert isinstance(refused.value, ValueError)
