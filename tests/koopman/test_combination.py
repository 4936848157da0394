import dataclasses

import casadi as ca
import numpy as np
import pytest
from ideal_data import ideal_dataset
from scipy.linalg import expm

from koopman_lab.errors import ModelError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.combination import exponential_action, generators
from koopman_lab.koopman.defects import defects
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method


def exact_d5t(v, omega, dt_s=0.05):
    L = np.zeros((5, 5))
    L[1, 3] = L[2, 4] = v
    L[3, 4], L[4, 3] = -omega, omega
    return expm(dt_s * L)


def d5t(combination, inputs=((0.0, 0.0), (0.2, -0.4), (0.2, 0.6)), dt_s=0.05):
    matrices = np.array([exact_d5t(v, omega, dt_s) for v, omega in inputs])
    observables = dictionary("D5t", "kinematic")
    return BilinearModel(observables, matrices, np.array(inputs), dt_s, {}, combination)


@pytest.mark.parametrize(
    "inputs", [((0, 0), (0.2, -0.4), (0.2, 0.6)), ((0.1, 0.2), (0.3, 0), (0, 1))]
)
def test_generators_are_exact_for_every_input_where_the_dictionary_is_invariant(inputs):
    model = d5t("generator", inputs)
    for v, omega in np.random.default_rng(0).uniform(-2, 2, (20, 2)):
        u = np.array([v, omega])
        rounding = 1e-15 * (1.0 + np.abs(model.lambdas(u)).sum())
        assert np.abs(model.matrix(u) - exact_d5t(v, omega)).max() < rounding
    many = model.matrix(np.zeros((3, 2, 2)))
    assert many.shape == (3, 2, 5, 5)


def test_symbols_agree_with_the_exponential_of_scipy_up_to_a_norm_of_two():
    rng = np.random.default_rng(1)
    A, psi = ca.SX.sym("A", 8, 8), ca.SX.sym("psi", 8)
    action = ca.Function("action", [A, psi], [exponential_action(A, psi)])
    for norm in (1e-3, 0.1, 1.0, 2.0):
        matrix, vector = rng.normal(size=(8, 8)), rng.normal(size=8)
        matrix *= norm / np.linalg.norm(matrix, 2)
        found = np.array(action(matrix, vector)).ravel()
        assert np.abs(found - expm(matrix) @ vector).max() < 1e-12 * np.abs(vector).sum()


@pytest.mark.parametrize(("kind", "name"), [("kinematic", "D5t"), ("dynamic", "D8Eul")])
def test_numbers_and_symbols_step_alike_and_the_basis_inputs_keep_their_matrices(kind, name):
    model, _ = train(ideal_dataset(kind, segments=40), name, Method(combination="generator"))
    assert model.combination == "generator"
    for matrix, u in zip(model.matrices, model.basis_inputs, strict=True):
        assert model.matrix(u) == pytest.approx(matrix, abs=1e-11)
    x, u, p = (
        ca.SX.sym("x", model.state_dim),
        ca.SX.sym("u", 2),
        ca.SX.sym("p", len(model.parameters)),
    )
    step = ca.Function("step", [x, u, p], [model.casadi_step()(x, u, p)])
    rng = np.random.default_rng(2)
    for _ in range(5):
        state, value = rng.normal(size=model.state_dim), rng.uniform(-1, 1, 2)
        found = np.array(step(state, value, model.parameters)).ravel()
        assert found == pytest.approx(model.step(state, value), abs=1e-12)


def test_the_combination_is_kept_in_the_file(tmp_path):
    d5t("generator").save(tmp_path / "model.npz")
    back = BilinearModel.load(tmp_path / "model.npz")
    assert back.combination == "generator"
    u = np.array([0.1, 1.0])
    assert np.array_equal(back.matrix(u), d5t("generator").matrix(u))


def test_matrices_without_a_real_logarithm_are_refused_in_words():
    with pytest.raises(ModelError, match=r"M_1 has the eigenvalue -1: no real generator.*--combin"):
        generators(np.array([np.eye(2), np.diag([1.0, -1.0])]))
    model = d5t("paper")
    broken = model.matrices.copy()
    broken[2, 0, 0] = 0.0
    with pytest.raises(ModelError, match="M_2"):
        dataclasses.replace(model, matrices=broken, combination="generator")


def test_turning_on_the_spot_moves_sideways_under_the_papers_formula_only():
    """Notes of the lab: v d_omega dt^2 / 2 = 1 mm at dt = 0.1 s, and 0.4 % growth a step."""
    paper, generator = defects(d5t("paper", dt_s=0.1)), defects(d5t("generator", dt_s=0.1))
    assert paper.sideways_m_per_rad == pytest.approx(1.0e-3, rel=2e-3)
    assert paper.growth_per_step == pytest.approx(0.004, rel=0.2)
    assert generator.sideways_m_per_rad < 1e-15
    assert generator.growth_per_step < 1e-14


def test_defects_of_the_second_order_robot_and_where_there_is_no_pair_on_a_circle():
    model, _ = train(ideal_dataset("dynamic", segments=40), "D8Eul")
    found = defects(model)
    assert 0.0 <= found.sideways_m_per_rad < 1e-3
    assert found.growth_per_step is not None
    monomials, _ = train(ideal_dataset("dynamic", segments=40), "D10m")
    assert defects(monomials).growth_per_step is None
