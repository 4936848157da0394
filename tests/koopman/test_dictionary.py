import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.errors import ModelError
from koopman_lab.koopman.dictionary import DICTIONARIES, dictionary

every = pytest.mark.parametrize("name", DICTIONARIES)


@every
def test_the_subscript_is_the_number_of_observables_and_the_first_is_constant(name):
    d = DICTIONARIES[name]
    assert str(d.size) in name
    x = np.random.default_rng(0).normal(size=(6, d.state_dim))
    psi = d.lift(x)
    assert psi.shape == (6, d.size)
    assert np.all(psi[:, 0] == 1.0)


@every
def test_names_say_what_the_observables_are(name):
    d = DICTIONARIES[name]
    x = np.random.default_rng(0).normal(size=d.state_dim)
    values = dict(zip(["x1", "x2", "theta", "v", "omega"], x, strict=False))
    values |= {"sin": np.sin, "cos": np.cos}
    expected = [eval(n.replace("^", "**"), {}, values) for n in d.names]
    assert d.lift(x) == pytest.approx(expected, abs=1e-12)


@every
@given(st.lists(st.floats(-3, 3), min_size=5, max_size=5))
def test_reprojection_undoes_the_lift(name, values):
    d = DICTIONARIES[name]
    x = np.array(values[: d.state_dim])
    assert d.project(d.lift(x)) == pytest.approx(x, abs=1e-12)
    far = x.copy()
    far[2] += 6 * np.pi
    if d.cosine_row is not None:
        assert d.project(d.lift(far), far[2] + 0.5) == pytest.approx(far, abs=1e-9)


@every
def test_arrays_and_symbols_agree(name):
    d = DICTIONARIES[name]
    x, previous = ca.SX.sym("x", d.state_dim), ca.SX.sym("t")
    psi = ca.vertcat(*d.observables(ca.vertsplit(x), ca))
    back = ca.vertcat(*d.project_components(ca.vertsplit(psi), previous, ca))
    function = ca.Function("f", [x, previous], [psi, back])
    for row in np.random.default_rng(0).normal(size=(10, d.state_dim)):
        lifted, projected = function(row, row[2] + 1.0)
        assert np.array(lifted).ravel() == pytest.approx(d.lift(row), abs=1e-14)
        assert np.array(projected).ravel() == pytest.approx(row, abs=1e-12)


def test_unknown_names_and_other_robots_are_explained():
    with pytest.raises(ModelError, match=r"'D9x': unknown.*D8Eul, D10m, D13t, D12f"):
        dictionary("D9x", "dynamic")
    with pytest.raises(ModelError, match=r"'D5t': is for the kinematic robot"):
        dictionary("D5t", "dynamic")
