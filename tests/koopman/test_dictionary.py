import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.config.load import load_config
from koopman_lab.errors import ModelError
from koopman_lab.koopman.dictionary import (
    DICTIONARIES,
    Dictionary,
    dictionary,
    from_expressions,
    register,
)

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


OWN = ("1", "x1", "x2", "theta", "v", "omega", "v * cos(theta)", "-v*sin(theta)/2", "v*theta^2*pi")


def test_expressions_are_what_they_say_in_arrays_and_symbols():
    own = dictionary(", ".join(OWN), "dynamic")
    assert (own.name, own.names, own.expressions) == ("D9own", OWN, OWN)
    assert own.state_rows == (1, 2, 3, 4, 5)
    x = np.random.default_rng(1).normal(size=(7, 5))
    theta, v = x[:, 2], x[:, 3]
    expected = [v * np.cos(theta), -v * np.sin(theta) / 2, v * theta**2 * np.pi]
    assert np.array_equal(own.lift(x)[:, 6:], np.column_stack(expected))
    symbols = ca.SX.sym("x", 5)
    lifted = ca.Function("f", [symbols], [ca.vertcat(*own.observables(ca.vertsplit(symbols), ca))])
    np.testing.assert_allclose(np.array(lifted(x.T)).T, own.lift(x), atol=1e-14)


def test_what_occurs_twice_is_computed_once():
    x = ca.SX.sym("x", 5)
    psi = ca.vertcat(*DICTIONARIES["D13t"].observables(ca.vertsplit(x), ca))
    function = ca.Function("f", [x], [psi])
    kinds = [function.instruction_id(i) for i in range(function.n_instructions())]
    assert (kinds.count(ca.OP_SIN), kinds.count(ca.OP_COS)) == (1, 1)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "x1.real",
        "x3",
        "x1 if x2 else v",
        "eval(x1)",
        "sin(x1, x2)",
        "x1**x2",
        "x1^10",
        "x1^-1",
        "[x1]",
        "'x1'",
        "1e999",
        "x1 +",
        "",
        "lambda: 1",
        "True",
        "(" * 199,
        "x1" + "+x1" * 100,
    ],
)
def test_anything_else_is_refused_with_the_expression(text):
    with pytest.raises(ModelError) as caught:
        from_expressions("mine", "dynamic", ("1", text))
    assert repr(text[:20])[:-1] in str(caught.value)
    assert "allowed are numbers, x1, x2, theta, v, omega, pi" in str(caught.value)


def test_dictionaries_that_lose_the_state_are_refused():
    for texts, message in (
        (("x1", "x2", "theta"), "expected the constant '1'"),
        ((), "expected the constant '1'"),
        (("1", "x1", "theta"), "no observable is the state x2"),
        (("1", "x1", "x2", "cos(theta)"), "add 'theta', or both"),
        (("1", "x1", "x2", "theta", "cos(theta)", "cos( theta )"), "occurs twice"),
    ):
        with pytest.raises(ModelError, match=message):
            from_expressions("mine", "kinematic", texts)


def test_a_list_in_yaml_is_a_dictionary():
    config = load_config(overrides=["model.dictionary=[1, x1, x2, cos(theta), sin(theta)]"])
    own = dictionary(config.model.dictionary, "kinematic")
    assert own.names == DICTIONARIES["D5t"].names
    assert (own.cosine_row, own.sine_row) == (3, 4)


def test_a_function_of_ones_own_is_found_by_its_name(monkeypatch):
    monkeypatch.setattr("koopman_lab.koopman.dictionary.DICTIONARIES", dict(DICTIONARIES))
    rows = (1, 2, 3)
    own = Dictionary("Dmine", "kinematic", ("1", "a", "b", "c"), lambda x, _: [1.0, *x], rows)
    register(own)
    register(own)
    assert dictionary("Dmine", "kinematic") is own
    assert own.expressions is None
    with pytest.raises(ModelError, match="there is one of this name"):
        register(Dictionary("D5t", "kinematic", ("1",), lambda *_: [1.0], rows))
    with pytest.raises(ModelError, match="state_rows"):
        register(Dictionary("D2", "kinematic", ("1",), lambda *_: [1.0], (1, 2, None)))
