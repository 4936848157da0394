"""Ways to fit: in batches, pulled towards the identity, with instruments, symmetric."""

import dataclasses

import numpy as np
import pykoop
import pytest
from ideal_data import ideal_dataset
from scipy.linalg import expm

from koopman_lab.errors import DataError, ModelError
from koopman_lab.evaluation.heldout import select_pairs
from koopman_lab.koopman.dictionary import DICTIONARIES, dictionary
from koopman_lab.koopman.excitation import excitation
from koopman_lab.koopman.fit import fit_matrix, fit_moments
from koopman_lab.koopman.lifted_samples import lag_us, lifted_samples
from koopman_lab.koopman.moments import Moments
from koopman_lab.koopman.symmetry import equivariant_basis
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method


def lifted(name="D8Eul", noise=1e-3, segments=20):
    kind = DICTIONARIES[name].kind
    dataset = ideal_dataset(kind, segments=segments, noise=noise)
    return lifted_samples(dataset, 1, dictionary(name, kind)).parts


def moments_of(parts, pieces=1):
    moments = Moments(parts[0].shape[1], instruments=len(parts) == 3)
    for rows in np.array_split(np.arange(len(parts[0])), pieces):
        moments.add(*(part[rows] for part in parts), segments=1)
    return moments


@pytest.mark.parametrize("name", ["D5t", "D8Eul", "D10m", "D13t", "D12f"])
def test_pykoop_finds_the_same_matrix(name):
    """Its normal equations square the condition, 120 at most, which costs some digits."""
    psi_x, psi_y = lifted(name)
    theirs = pykoop.Edmd().fit(psi_x, psi_y).coef_.T
    assert fit_matrix(psi_x, psi_y).matrix == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize("pieces", [2, 7, 200])
def test_batches_give_what_one_piece_gives(pieces):
    parts = lifted()
    whole, merged = moments_of(parts), moments_of(parts, pieces)
    assert (merged.samples, merged.segments) == (whole.samples, pieces)
    at_once = np.linalg.lstsq(*parts, rcond=None)[0].T
    one, many = fit_moments(whole), fit_moments(merged)
    assert one.matrix == pytest.approx(at_once, abs=1e-10)
    assert many.matrix == pytest.approx(one.matrix, abs=1e-10)
    errors = parts[1] - parts[0] @ one.matrix.T
    assert many.residual_rms == pytest.approx(np.sqrt(np.mean(errors**2, axis=0)), abs=1e-12)
    values = np.linalg.svd(parts[0] / whole.scale, compute_uv=False) / np.sqrt(whole.samples)
    for moments in (whole, merged):
        found = excitation(moments)
        assert found.smallest_singular_value == pytest.approx(values[-1], rel=1e-10)
        assert (found.rank, found.condition) == (8, pytest.approx(values[0] / values[-1]))


def test_several_data_sets_are_one_to_the_fit_but_must_be_alike():
    whole = ideal_dataset("dynamic", segments=20, noise=1e-3)
    first = {i: s < 9 for i, s in whole.segments.items()}
    parts = [
        select_pairs(whole, first),
        select_pairs(whole, {i: ~mask for i, mask in first.items()}),
    ]
    together, report = train(iter(parts), "D8Eul")
    alone, single = train(whole, "D8Eul")
    assert together.matrices == pytest.approx(alone.matrices, abs=1e-10)
    assert [b.excitation.segments for b in report.bases] == [20, 20, 20]
    assert report.data_hash != single.data_hash
    assert [len(s["pairs"]) for s in together.metadata["sources"]] == [3, 3]
    with pytest.raises(DataError, match=r"dt_s is 0\.05 in the first, 0\.1"):
        train([whole, dataclasses.replace(whole, dt_s=0.1)], "D8Eul")
    with pytest.raises(DataError, match="given twice"):
        train([whole, whole], "D8Eul")
    with pytest.raises(DataError, match="no data set"):
        train([], "D8Eul")


def test_the_pull_leaves_the_constant_alone_and_ends_at_the_identity():
    psi_x, psi_y = lifted()
    moments = moments_of((psi_x, psi_y))
    free = fit_moments(moments)
    assert fit_moments(moments, ridge=1e-14).matrix == pytest.approx(free.matrix, abs=1e-9)
    pulled = fit_moments(moments, ridge=1e9).matrix
    assert pulled[:, 1:] == pytest.approx(np.eye(8)[:, 1:], abs=1e-6)
    # What is left is the mean change: the input's effect, not shrunk.
    assert pulled[:, 0] - np.eye(8)[0] == pytest.approx(np.mean(psi_y - psi_x, axis=0), abs=1e-6)
    sizes = [
        np.linalg.norm(fit_moments(moments, ridge=r).matrix[:, 1:] - np.eye(8)[:, 1:])
        for r in (0.0, 1e-2, 1.0)
    ]
    assert sizes == sorted(sizes, reverse=True)


def test_a_combination_holds_with_an_input_u_0_that_is_not_zero():
    dataset = ideal_dataset("dynamic", segments=40)
    offset = np.array([0.1, -0.2])
    shifted = dataclasses.replace(
        dataset,
        basis_inputs={i: u + offset for i, u in dataset.basis_inputs.items()},
    )
    # The same samples, said to be of other inputs: the model is that of u - offset.
    model, moved = train(dataset, "D8Eul")[0], train(shifted, "D8Eul")[0]
    u = np.array([0.3, 0.7])
    assert moved.matrix(u + offset) == pytest.approx(model.matrix(u), abs=1e-12)


def noisy_integrator(noise, runs=60, length=100, seed=3):
    """Return a data set of the second-order robot whose yaw rate is seen with noise.

    Neighbouring samples are a frame apart, the successor 12 frames later, as in the lab.
    """
    ideal = ideal_dataset("dynamic", segments=runs, steps=length, dt_s=1 / 240, seed=seed)
    rng = np.random.default_rng(seed)
    ahead, tables = 12, {name: {} for name in ("X", "Y", "segments", "start_us")}
    for index, x in ideal.X.items():
        path = x.reshape(runs, length, 5).copy()
        path[..., 2] = np.unwrap(path[..., 2], axis=1)
        path[..., 4] += noise * rng.normal(size=path.shape[:2])
        count = length - ahead
        tables["X"][index] = path[:, :count].reshape(-1, 5)
        tables["Y"][index] = path[:, ahead:].reshape(-1, 5)
        tables["segments"][index] = np.repeat(np.arange(runs), count)
        tables["start_us"][index] = np.tile(np.round(np.arange(count) * 1e6 / 240), runs).astype(
            int
        )
    metadata = {"frame_rate_hz": 240.0, "processing": {"smoothing_window": 1}}
    return dataclasses.replace(ideal, **tables, dt_s=0.05, metadata=metadata)


def test_instruments_take_away_the_bias_that_noise_leaves():
    dataset = noisy_integrator(0.3)
    assert lag_us(dataset) == 12_500  # three frames: one between those of two differences
    plain, _ = train(dataset, "D8Eul")
    iv, report = train(dataset, "D8Eul", Method(estimator="iv"))
    assert plain.matrices[0][5, 5] < 0.9
    assert iv.matrices[0][5, 5] == pytest.approx(1.0, abs=0.02)
    assert iv.matrices[0][3, 5] == pytest.approx(0.05, rel=0.02)
    assert all(0.1 < b.weakest_instrument <= 1.0 for b in report.bases)
    assert np.array_equal(iv.matrices[:, 0], np.tile(np.eye(8)[0], (3, 1)))


def test_instruments_need_times():
    dataset = ideal_dataset("dynamic", segments=20)
    with pytest.raises(DataError, match="train from a session, or use --estimator plain"):
        train(dataset, "D8Eul", Method(estimator="iv"))


@pytest.mark.parametrize("name", ["D5t", "D6Eul", "D7m", "D8Eul", "D13t", "D12f"])
def test_symmetric_models_predict_alike_wherever_the_robot_stands(name):
    kind = DICTIONARIES[name].kind
    model, _ = train(ideal_dataset(kind, segments=12, noise=1e-2), name, Method(symmetric=True))
    rng = np.random.default_rng(4)
    x = rng.uniform(-0.5, 0.5, (20, model.state_dim))
    u = rng.uniform(-1.0, 1.0, (20, 2))
    moved, ahead = move(x), model.step(x, u)
    assert model.step(moved, u) == pytest.approx(move(ahead), abs=1e-10)
    assert np.array_equal(model.matrices[:, 0], np.tile(np.eye(model.dictionary.size)[0], (3, 1)))


def move(x, by=(0.7, -0.3, 0.9)):
    moved = x.copy()
    c, s = np.cos(by[2]), np.sin(by[2])
    moved[:, 0] = by[0] + c * x[:, 0] - s * x[:, 1]
    moved[:, 1] = by[1] + s * x[:, 0] + c * x[:, 1]
    moved[:, 2] += by[2]
    return moved


def test_symmetry_is_exact_where_the_model_is_and_needs_fewer_runs():
    dataset = ideal_dataset("kinematic", segments=1)
    with pytest.raises(DataError, match="span only 3 of the 5"):
        train(dataset, "D5t")
    model, _ = train(dataset, "D5t", Method(symmetric=True))
    for matrix, (v, omega) in zip(model.matrices, model.basis_inputs, strict=True):
        L = np.zeros((5, 5))
        L[1, 3] = L[2, 4] = v
        L[3, 4], L[4, 3] = -omega, omega
        assert matrix == pytest.approx(expm(0.05 * L), abs=1e-12)


def test_dictionaries_that_a_turn_leaves_cannot_be_symmetric():
    with pytest.raises(
        ModelError, match=r"D10m: turning by 1 rad makes of 'v\*theta\^2' something"
    ):
        equivariant_basis(DICTIONARIES["D10m"])
    few = ideal_dataset("dynamic", segments=1, steps=1)
    with pytest.raises(DataError, match=r"basis input 0: the samples determine only \d+ of the 13"):
        train(few, "D8Eul", Method(symmetric=True))
