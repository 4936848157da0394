import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from ideal_data import ideal_dataset
from scipy.linalg import expm

from koopman_lab.errors import DataError, ModelError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import (
    DICTIONARIES,
    Dictionary,
    from_expressions,
    register,
)
from koopman_lab.koopman.excitation import dependent_observable
from koopman_lab.koopman.fit import fit_matrix
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.predictors.predictor import require_robot
from koopman_lab.robots.table import robot_type


def d5t_generator(v, omega):
    """Return d psi/dt = L psi of (1, x1, x2, cos, sin) for constant v and omega."""
    L = np.zeros((5, 5))
    L[1, 3] = L[2, 4] = v
    L[3, 4], L[4, 3] = -omega, omega
    return L


def test_d5t_on_ideal_data_is_the_matrix_exponential():
    model, report = train(ideal_dataset("kinematic"), "D5t")
    assert np.array_equal(model.matrices[0], np.eye(5))
    for matrix, (v, omega) in zip(model.matrices[1:], [(0.2, -0.4), (0.2, 0.6)], strict=True):
        assert matrix == pytest.approx(expm(0.05 * d5t_generator(v, omega)), abs=1e-12)
    assert max(b.constant_residual for b in report.bases) < 1e-12


@pytest.mark.parametrize("name", ["D5t", "D6Eul"])
def test_dictionaries_that_the_robot_leaves_invariant_reproduce_it(name):
    dataset = ideal_dataset("kinematic", segments=20)
    model, _ = train(dataset, name)
    for index, u in dataset.basis_inputs.items():
        assert np.abs(model.step(dataset.X[index], u) - dataset.Y[index]).max() < 1e-12


@pytest.mark.parametrize("name", ["D8Eul", "D13t", "D12f"])
def test_one_step_errors_stay_below_the_term_that_the_dictionary_lacks(name):
    """The observables carry the first order in dt; the second is v omega dt^2 / 2."""
    dataset = ideal_dataset("dynamic", segments=40)
    model, _ = train(dataset, name)
    for index, u in dataset.basis_inputs.items():
        X, Y = dataset.X[index], dataset.Y[index]
        error = np.abs(model.step(X, u) - Y).max(axis=0)
        v, omega = np.abs(X[:, 3]).max(), np.abs(X[:, 4]).max()
        assert error[:2].max() < v * omega * 0.05**2 / 2
        assert error[2] < omega**2 * 0.05**2 / 2
        assert error[3:].max() < 1e-10


def test_what_is_linear_in_the_observables_is_learned_exactly():
    """theta, v and omega of D8Eul move by exact affine rules."""
    model, _ = train(ideal_dataset("dynamic", segments=40), "D8Eul")
    u = np.array([0.31, -0.7])
    M = model.matrix(u)
    assert M[4] == pytest.approx([0.05 * u[0], 0, 0, 0, 1, 0, 0, 0], abs=1e-10)
    assert M[5] == pytest.approx([0.05 * u[1], 0, 0, 0, 0, 1, 0, 0], abs=1e-10)
    assert M[3] == pytest.approx([0.05**2 * u[1] / 2, 0, 0, 1, 0, 0.05, 0, 0], abs=1e-10)


def test_least_squares_is_that_of_the_normal_equations_where_those_are_harmless():
    rng = np.random.default_rng(0)
    x = np.column_stack([np.ones(200), rng.normal(size=(200, 4))])
    y = np.column_stack([np.ones(200), rng.normal(size=(200, 4))])
    K = np.linalg.solve(x.T @ x, x.T @ y)
    assert fit_matrix(x, y).matrix == pytest.approx(K.T, abs=1e-12)


def test_basis_inputs_give_their_own_matrices_and_lambdas_add_up():
    dataset = ideal_dataset("dynamic", segments=40)
    model, _ = train(dataset, "D8Eul")
    shifted = dataclasses.replace(model, basis_inputs=model.basis_inputs + np.array([0.1, -0.3]))
    for m in (model, shifted):
        for matrix, u in zip(m.matrices, m.basis_inputs, strict=True):
            assert m.matrix(u) == pytest.approx(matrix, abs=1e-12)
        u = np.array([0.4, -1.1])
        u0, u1, u2 = m.basis_inputs
        lambdas = m.lambdas(u)
        assert lambdas[0] * (u1 - u0) + lambdas[1] * (u2 - u0) + u0 == pytest.approx(u)


@pytest.mark.parametrize(("kind", "name"), [("kinematic", "D5t"), ("dynamic", "D8Eul")])
def test_prediction_over_a_second_and_symbols(kind, name):
    import casadi as ca

    model, _ = train(ideal_dataset(kind, segments=40), name)
    rng = np.random.default_rng(1)
    inputs = rng.uniform(-0.3, 0.3, (20, 2))
    x0 = np.array([0.4, 0.1, 3.0, 0.2, 0.5])[: model.state_dim]
    path, nominal = model.predict(x0, inputs), [x0]
    for u in inputs:
        nominal.append(robot_type(kind).step(nominal[-1], u, 0.05))
    assert np.abs(path - nominal).max() < 0.02
    x, u = ca.SX.sym("x", model.state_dim), ca.SX.sym("u", 2)
    step = ca.Function("step", [x, u], [model.casadi_step()(x, u, ca.DM(model.parameters))])
    for before, value, after in zip(path[:-1], inputs, path[1:], strict=True):
        assert np.array(step(before, value)).ravel() == pytest.approx(after, abs=1e-12)


def test_without_reprojection_the_observables_are_propagated():
    model, _ = train(ideal_dataset("dynamic", segments=40), "D13t")
    inputs = np.full((20, 2), 0.1)
    x0 = np.array([0.4, 0.1, 0.3, 0.2, 0.5])
    psi = model.dictionary.lift(x0)
    for u in inputs:
        psi = model.matrix(u) @ psi
    end = model.predict(x0, inputs, reproject=False)[-1]
    assert end[[0, 1, 3, 4]] == pytest.approx(psi[[1, 2, 5, 6]], abs=1e-12)


def test_one_constant_input_run_is_refused_with_the_remedy():
    with pytest.raises(DataError, match=r"span only 3 of the 5 .*--segments"):
        train(ideal_dataset("kinematic", segments=1), "D5t")
    with pytest.raises(DataError, match="span only"):
        train(ideal_dataset("dynamic", segments=2, noise=1e-4), "D8Eul")
    empty = ideal_dataset("kinematic")
    empty.X[2], empty.Y[2] = empty.X[2][:0], empty.Y[2][:0]
    empty.segments[2] = empty.segments[2][:0]
    with pytest.raises(DataError, match="basis input 2: no samples"):
        train(empty, "D5t")


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("ridge", [1e-12, 1e-4, 1.0])
def test_a_ridge_serves_samples_that_do_not_span_the_dictionary(ridge, symmetric):
    """It predicts on the curve that was recorded; the rest is pulled to the identity."""
    dataset = ideal_dataset("kinematic", segments=1)
    model, report = train(dataset, "D5t", Method(ridge=ridge, symmetric=symmetric))
    assert all(basis.excitation.rank == 3 for basis in report.bases if basis.excitation)
    assert np.isfinite(model.matrices).all()
    if ridge < 1e-3:
        for index, u in dataset.basis_inputs.items():
            assert model.step(dataset.X[index], u) == pytest.approx(dataset.Y[index], abs=1e-3)


def test_a_ridge_too_small_to_determine_anything_is_no_ridge():
    with pytest.raises(DataError, match=r"basis input 1: .* span only 3 of the 5 .*--ridge"):
        train(ideal_dataset("kinematic", segments=1), "D5t", Method(ridge=1e-30))


def test_no_remedy_is_proposed_that_cannot_help():
    """Observables that add up to another one do so for every sample that could be recorded."""
    dataset = ideal_dataset("kinematic", segments=40)
    with pytest.raises(DataError) as refused:
        train(dataset, "1, x1, x2, theta, sin(theta)^2, x1*x2, cos(theta)^2")
    assert "'cos(theta)^2' is a combination of the observables before it" in str(refused.value)
    assert "klab calibrate" not in str(refused.value)
    for name, known in DICTIONARIES.items():
        assert dependent_observable(known) is None, name
    powers = [f"x1^{i}*x2^{j}" for i in range(6) for j in range(6) if i + j > 1]
    many = from_expressions("Dmany", "kinematic", ["1", "x1", "x2", "theta", *powers])
    assert dependent_observable(many) is None


def test_a_model_file_keeps_every_bit_and_the_same_data_give_the_same_file(tmp_path):
    dataset = ideal_dataset("dynamic", noise=1e-3)
    model, report = train(dataset, "D8Eul")
    model.save(tmp_path / "a.npz")
    train(ideal_dataset("dynamic", noise=1e-3), "D8Eul")[0].save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = BilinearModel.load(tmp_path / "a.npz")
    assert np.array_equal(back.matrices, model.matrices)
    assert np.array_equal(back.basis_inputs, model.basis_inputs)
    assert (back.dt_s, back.dictionary.name) == (0.05, "D8Eul")
    assert back.metadata["training"]["data_hash"] == report.data_hash
    assert {p.name for p in tmp_path.iterdir()} == {"a.npz", "b.npz"}


def test_a_model_file_explains_its_dictionary_and_needs_no_registry(tmp_path):
    texts = "1, x1, x2, theta, v, omega, v*cos(theta), v*sin(theta), omega^2"
    model, _ = train(ideal_dataset("dynamic", segments=40), texts)
    model.save(tmp_path / "model.npz")
    back = BilinearModel.load(tmp_path / "model.npz")
    assert back.dictionary == model.dictionary
    assert ", ".join(back.dictionary.expressions) == texts
    x, u = np.array([0.1, 0.2, 3.0, 0.2, 0.5]), np.array([0.1, 0.4])
    assert np.array_equal(back.step(x, u), model.step(x, u))


def test_metadata_say_how_and_of_what_the_model_was_made(tmp_path):
    dataset = ideal_dataset("dynamic", segments=40)
    origin = {"file": "/somewhere/session.lcm", "sha256": "0" * 64}
    dataset = dataclasses.replace(dataset, metadata={"source": origin})
    method = Method(ridge=1e-6, symmetric=True, combination="generator")
    train(dataset, "D8Eul", method)[0].save(tmp_path / "model.npz")
    metadata = BilinearModel.load(tmp_path / "model.npz").metadata
    assert metadata["training"]["method"] == dataclasses.asdict(method)
    assert metadata["training"]["bases"][1]["excitation"]["rank"] == 8
    assert metadata["training"]["defects"]["sideways_m_per_rad"] < 1e-3
    (data,) = metadata["sources"]
    assert data["data_hash"] == dataset.data_hash
    assert data["pairs"] == {"0": 1600, "1": 1600, "2": 1600}
    # Of the session, not of the training: the same data give the same file.
    assert data["recorded_utc"] is None
    assert metadata["data"]["source"] == origin | {"file": "session.lcm"}
    assert set(metadata["versions"]) == {"koopman-lab", "numpy", "scipy"}


def test_a_dictionary_of_functions_must_be_known_before_its_model_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr("koopman_lab.koopman.dictionary.DICTIONARIES", dict(DICTIONARIES))
    own = Dictionary(
        "Dmine",
        "kinematic",
        ("one", "along", "across", "c", "s"),
        DICTIONARIES["D5t"].observables.__call__,
        (1, 2, None),
        3,
        4,
    )
    model, _ = train(ideal_dataset("kinematic"), own)
    model.save(tmp_path / "model.npz")
    with pytest.raises(ModelError, match=r"'Dmine': unknown.*must be registered"):
        BilinearModel.load(tmp_path / "model.npz")
    register(own)
    assert np.array_equal(BilinearModel.load(tmp_path / "model.npz").matrices, model.matrices)


def rewritten(path, **changes):
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(bytes(arrays["header"])) | changes
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": 99}, "model file of format 99, this version reads 1 and 2; train it again"),
        ({"dictionary": "D8Eul"}, "is for the dynamic robot"),
        ({"observables": ["1"]}, "its observables are not those of D5t"),
        ({"combination": "product"}, "combination 'product' of inputs is not known here"),
        ({"dictionary": "D5own", "expressions": ["1", "x1.real"]}, "'x1.real' is not allowed"),
    ],
)
def test_files_of_another_version_or_dictionary_are_refused_in_words(tmp_path, changes, message):
    path = tmp_path / "model.npz"
    train(ideal_dataset("kinematic"), "D5t")[0].save(path)
    rewritten(path, **changes)
    with pytest.raises(ModelError, match=message):
        BilinearModel.load(path)


def test_models_of_format_1_are_those_of_the_papers_combination():
    model = BilinearModel.load(Path(__file__).parent.parent / "data" / "reference" / "model.npz")
    assert (model.combination, model.dictionary.name) == ("paper", "D5t")


def test_files_that_are_no_model_and_models_of_the_other_robot(tmp_path):
    with pytest.raises(ModelError, match="no such model"):
        BilinearModel.load(tmp_path / "none.npz")
    model, _ = train(ideal_dataset("kinematic"), "D5t")
    path = tmp_path / "model.npz"
    model.save(path)
    whole = path.read_bytes()
    for content in (b"", b"text", whole[:100], whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(ModelError, match="damaged, or not a model"):
            BilinearModel.load(path)
    np.savez(path, other=np.ones(3))
    with pytest.raises(ModelError, match="damaged, or not a model"):
        BilinearModel.load(path)
    with pytest.raises(ModelError, match="--robot kinematic"):
        require_robot(model, "dynamic")
