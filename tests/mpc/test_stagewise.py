"""What is compiled is the written-out problem, and nobody needs the compiler."""

import os
import stat

import casadi as ca
import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.files import CACHE_VARIABLE
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.mpc import compiled, stagewise
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.ocp import Bounds, transcribe
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import make_solver
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.nominal import NominalPrediction

CASES = [
    ("nominal dynamic", 1, "me"),
    ("nominal kinematic", 3, "ce"),
    ("D5t", 2, "ds"),
    ("D5t lifted", 3, "me"),
    ("D8Eul lifted", 2, "ds"),
]
"""Every kind of model and cost at least once; a case is a second of compiling."""


def prediction(name, seed=0):
    if name.startswith("nominal"):
        return NominalPrediction(name.split()[1], 0.05)
    name, *lifted = name.split()
    kind = "kinematic" if name == "D5t" else "dynamic"
    observables, rng = dictionary(name, kind), np.random.default_rng(seed)
    size = observables.size
    matrices = np.eye(size) + 0.05 * rng.normal(size=(3, size, size))
    inputs = np.array([[0.0, 0.0], [0.2, -0.1], [0.1, 0.5]])
    model = BilinearModel(observables, matrices, inputs, 0.05, {})
    return LiftedPrediction(model) if lifted else KoopmanPrediction(model)


def weights(model, name="me"):
    overrides = [f"controller.cost={name}"]
    settings = load_config(robot=model.robot.name, overrides=overrides).controller
    return stage_cost(settings, model.robot, model.dictionary)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.mark.parametrize(("name", "horizon", "cost_name"), CASES)
def test_compiled_functions_are_those_of_the_written_out_program(name, horizon, cost_name):
    model, rng = prediction(name), np.random.default_rng(1)
    cost = weights(model, cost_name)
    program = transcribe(model, cost, horizon, Bounds(np.ones(2))).program
    x, p, f, g = (program[key] for key in "xpfg")
    lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", g.numel())
    lagrangian = lam_f * f + ca.dot(lam_g, g)
    oracle = ca.Function(
        "oracle",
        [x, p, lam_f, lam_g],
        [f, g, ca.gradient(f, x), ca.jacobian(g, x), ca.hessian(lagrangian, x)[0]],
    )
    path = str(compiled.library(stagewise.source(model, cost, horizon)))
    at = rng.normal(size=x.numel())
    own = np.append(rng.normal(size=model.size), 3.0)
    full = np.concatenate([own, stagewise.parameters_of(model, cost)])
    multipliers = (0.7, rng.normal(size=g.numel()))
    expected_f, expected_g, gradient, jacobian, hessian = map(
        np.asarray, oracle(at, own, *multipliers)
    )

    def call(function, *arguments):
        answer = ca.external(function, path)(*arguments)
        return [np.asarray(part) for part in answer] if isinstance(answer, tuple) else answer

    def same(found, expected):
        np.testing.assert_allclose(np.asarray(found), expected, rtol=1e-11, atol=1e-11)

    same(call("nlp_f", at, full), expected_f)
    same(call("nlp_g", at, full), expected_g)
    same(call("nlp", at, full)[1], expected_g)
    same(call("nlp_grad_f", at, full), gradient)
    for found, expected in zip(call("nlp_jac_g", at, full), (expected_g, jacobian), strict=True):
        same(found, expected)
    d_lagrangian = 0.7 * gradient + jacobian.T @ multipliers[1][:, None]
    found = call("nlp_hess_l", at, full, *multipliers)
    same(found[0], d_lagrangian)
    same(found[1], hessian)
    same(call("nlp_grad", at, full, *multipliers)[2], d_lagrangian)

    x0, inputs = rng.normal(size=model.state_dim), rng.normal(size=(horizon, 2))
    both = [Rollout(model, cost, horizon, made).trajectory(x0, inputs) for made in (None, path)]
    for found, wanted in zip(*both, strict=True):
        same(found, wanted)


@pytest.mark.parametrize(
    ("name", "x0", "back_end", "rel"),
    [("D5t", [0.0, 0.5, 0.0], "fatrop", 1e-9), ("D8Eul lifted", [0.3] * 5, "ddp", 1e-6)],
)
def test_one_library_serves_every_model_of_a_dictionary(cache, name, x0, back_end, rel):
    for seed in (1, 2):
        model = prediction(name, seed)
        guess = np.full((4, 2), 0.05)
        plans = [
            make_solver(model, weights(model), 4, (0.4, 1.0), back_end, use_compiler=wanted).solve(
                np.array(x0), guess
            )
            for wanted in (True, False)
        ]
        assert all(plan.ok for plan in plans)
        assert plans[0].value == pytest.approx(plans[1].value, rel=rel)
        np.testing.assert_allclose(plans[0].inputs, plans[1].inputs, atol=1e-3)
    assert len(list((cache / compiled.FOLDER).glob("*.so"))) == 1


def solver():
    model = NominalPrediction("kinematic", 0.05)
    return make_solver(model, weights(model), 3, (0.4, 1.0))


def solves(made):
    return made.solve(np.array([0.1, 0.1, 0.0]), np.full((3, 2), 0.1)).ok


def script(folder, name, text):
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_without_a_compiler_the_problem_is_written_out(cache, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    made = solver()
    assert made.description == "fatrop, not compiled: no C compiler"
    assert solves(made)
    assert not cache.exists()


def test_a_compiler_that_fails_is_quoted(cache, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", script(tmp_path, "broken", "echo no licence >&2; exit 1"))
    made = solver()
    assert "not compiled" in made.description
    assert "no licence" in made.description
    assert solves(made)
    assert not list((cache / compiled.FOLDER).iterdir())


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    monkeypatch.setenv(CACHE_VARIABLE, str(in_the_way))
    made = solver()
    assert str(in_the_way) in made.description
    assert solves(made)


@pytest.mark.usefixtures("cache")
def test_what_is_compiled_once_is_used_again(tmp_path, monkeypatch):
    log = tmp_path / "log"
    compiler = os.environ.get("CC", "cc")
    counting = script(tmp_path, "counting", f'echo run >> {log}\nexec {compiler} "$@"')
    monkeypatch.setenv("CC", counting)
    for _ in range(2):
        made = solver()
        assert made.description == "ddp, compiled"
        assert solves(made)
    assert log.read_text() == "run\n"


def test_what_a_compiler_makes_must_load(cache, tmp_path, monkeypatch):
    # The last argument but one names the library.
    monkeypatch.setenv(
        "CC", script(tmp_path, "odd", 'while [ "$1" != -o ]; do shift; done; echo x > "$2"')
    )
    assert "cannot be loaded" in solver().description
    assert cache.exists()


def test_the_source_is_the_same_in_every_run():
    model = prediction("D8Eul")
    first, again = (stagewise.source(model, weights(model), 5) for _ in range(2))
    assert first == again
