"""The quadratic program of a stage in ddp.c, for any number of inputs and for two of them."""

import ctypes
import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import koopman_lab.mpc.ddp
from koopman_lab.config.load import load_config
from koopman_lab.mpc import compiled, ddp
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.rollout import Rollout
from koopman_lab.mpc.solver import MOST_ITERATIONS, make_solver
from koopman_lab.predictors.nominal import NominalPrediction

FOLDER = Path(koopman_lab.mpc.ddp.__file__).parent
CHOICE = "#if INPUTS == 2"
WRAPPED = """
#include <math.h>
#include <string.h>
#define INPUTS {inputs}
static double clip(double x, double low, double high) {{ return fmin(fmax(x, low), high); }}
{program}
int lift(double *Q, double least) {{ return make_positive((double (*)[INPUTS])Q, least); }}
void minimise(double *Q, double *q, double *low, double *high, double *d, int *is_free) {{
  box((double (*)[INPUTS])Q, q, low, high, d, is_free);
}}
void respond(double *Q, int *is_free, double *column, double *k) {{
  feedback((double (*)[INPUTS])Q, is_free, column, k);
}}
"""
PROGRAMS = [(1, "ddp_any_inputs.c"), (2, "ddp_two_inputs.c"), (2, "ddp_any_inputs.c")]
PROGRAMS += [(inputs, "ddp_any_inputs.c") for inputs in (3, 4, 8)]


@pytest.fixture(scope="module")
def programs():
    made = {}
    for inputs, name in PROGRAMS:
        text = WRAPPED.format(inputs=inputs, program=(FOLDER / name).read_text())
        made[inputs, name] = ctypes.CDLL(str(compiled.library(text)))
    return made


def pointers(*arrays):
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]


def minimised(library, Q, q, low, high):
    """Return d and which of its components are free."""
    d, is_free = np.full(len(q), np.nan), np.zeros(len(q), np.int32)
    library.minimise(*pointers(Q, q, low, high, d, is_free))
    return d, is_free.astype(bool)


def best_of_all_faces(Q, q, low, high):
    """Return the least cost over the box: of all faces, the minimisers that lie in the box."""
    costs = []
    for sides in itertools.product((None, low, high), repeat=len(q)):
        d = np.array([0.0 if side is None else side[i] for i, side in enumerate(sides)])
        free = [i for i, side in enumerate(sides) if side is None]
        if free:
            d[free] = np.linalg.solve(Q[np.ix_(free, free)], -(q[free] + (Q @ d)[free]))
        if np.all((d >= low - 1e-12) & (d <= high + 1e-12)):
            costs.append(0.5 * d @ Q @ d + q @ d)
    return min(costs)


def drawn(seed, inputs, spread):
    """Return a positive definite Q, a slope q, and a box around zero; sides may be zero."""
    rng = np.random.default_rng(seed)
    turned, _ = np.linalg.qr(rng.normal(size=(inputs, inputs)))
    Q = turned @ np.diag(10.0 ** rng.uniform(-spread, spread, inputs)) @ turned.T
    Q = 0.5 * (Q + Q.T)
    q = rng.normal(size=inputs) * 10.0 ** rng.uniform(-2, 1)
    low, high = -rng.exponential(size=inputs), rng.exponential(size=inputs)
    low[rng.uniform(size=inputs) < 0.2] = 0.0
    high[rng.uniform(size=inputs) < 0.2] = 0.0
    return Q, q, low, high


@pytest.mark.parametrize("program", [p for p in PROGRAMS if p[0] < 8])
@given(seed=st.integers(0, 2**32), spread=st.floats(0.0, 3.0))
def test_the_minimum_in_a_box_is_the_best_of_all_faces(programs, program, seed, spread):
    Q, q, low, high = drawn(seed, program[0], spread)
    d, is_free = minimised(programs[program], Q, q, low, high)
    assert np.all((d >= low) & (d <= high))
    cost, best = 0.5 * d @ Q @ d + q @ d, best_of_all_faces(Q, q, low, high)
    assert cost == pytest.approx(best, rel=1e-9, abs=1e-12)
    # Off its bounds a component is where its slope is zero; on them it is held back.
    r = Q @ d + q
    scale = np.abs(Q).max() * np.abs(d).max() + np.abs(q).max()
    assert np.all(np.abs(r[is_free]) <= 1e-8 * scale)
    for i in np.flatnonzero(~is_free):
        assert (d[i] == low[i] and r[i] >= -1e-8 * scale) or (
            d[i] == high[i] and r[i] <= 1e-8 * scale
        )


@given(seed=st.integers(0, 2**32))
def test_eight_inputs_meet_the_conditions_of_optimality(programs, seed):
    Q, q, low, high = drawn(seed, 8, 2.0)
    d, _ = minimised(programs[8, "ddp_any_inputs.c"], Q, q, low, high)
    r = Q @ d + q
    # A step against the slope that ends in the box is none.
    np.testing.assert_allclose(np.clip(d - r / np.abs(Q).max(), low, high), d, atol=1e-9)


@pytest.mark.parametrize("program", PROGRAMS)
@given(seed=st.integers(0, 2**32), least=st.floats(1e-6, 2.0))
def test_eigenvalues_are_raised_to_their_magnitudes(programs, program, seed, least):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(program[0], program[0])) * 10.0 ** rng.uniform(-3, 3)
    A = A + A.T
    values, vectors = np.linalg.eigh(A)
    raised = vectors @ np.diag(np.maximum(np.abs(values), least)) @ vectors.T
    Q = A.copy()
    negative = programs[program].lift(*pointers(Q), ctypes.c_double(least))
    np.testing.assert_allclose(Q, raised, atol=1e-12 * np.abs(A).max() + 1e-14, rtol=1e-10)
    assert bool(negative) == bool(values[0] < 0.0)
    if values[0] > least:
        np.testing.assert_array_equal(Q, A)


@pytest.mark.parametrize("program", PROGRAMS)
@given(seed=st.integers(0, 2**32))
def test_the_feedback_solves_for_the_free_components(programs, program, seed):
    rng, inputs = np.random.default_rng(seed), program[0]
    Q, column, *_ = drawn(seed, inputs, 1.0)
    is_free = rng.integers(0, 2, inputs).astype(np.int32)
    k = np.full(inputs, np.nan)
    programs[program].respond(*pointers(Q, is_free, column, k))
    free = is_free.astype(bool)
    assert not k[~free].any()
    np.testing.assert_allclose((Q @ k + column)[free], 0.0, atol=1e-9 * np.abs(column).max())


@pytest.mark.parametrize("program", PROGRAMS)
def test_what_is_no_number_ends_and_stays_none(programs, program):
    inputs = program[0]
    d, _ = minimised(
        programs[program],
        np.eye(inputs),
        np.full(inputs, np.nan),
        np.full(inputs, -1.0),
        np.ones(inputs),
    )
    assert not np.any(np.abs(d) < 1.0)


@pytest.mark.parametrize("cost_name", ["me", "ce"])
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_two_inputs_are_solved_alike_in_closed_form_and_by_iterations(robot, cost_name):
    settings = load_config(robot=robot, overrides=[f"controller.cost={cost_name}"]).controller
    model = NominalPrediction(robot, settings.dt_s)
    cost, horizon = stage_cost(settings, model.robot), 12
    solver = make_solver(model, cost, horizon, settings.u_max)
    source = ddp.source(model, cost, horizon)
    assert source.count(CHOICE) == 1
    library = compiled.library(source.replace(CHOICE, "#if 0"))
    any_number = ddp.Improver(
        library, model, cost, np.array(settings.u_max), MOST_ITERATIONS["ddp"]
    )
    rollout, rng = Rollout(model, cost, horizon), np.random.default_rng(0)
    for _ in range(30):
        x0 = rng.normal(size=model.state_dim)
        guess = rng.uniform(-1.0, 1.0, (horizon, 2)) * settings.u_max
        plan = solver.solve(x0, guess)
        inputs, count = any_number(x0, guess)
        assert (count >= 0) == (plan.status == "ddp: converged")
        assert rollout(x0, inputs)[1] == pytest.approx(plan.value, rel=1e-6)
