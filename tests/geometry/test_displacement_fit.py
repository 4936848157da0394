import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from koopman_lab.geometry.displacement_fit import fit_displacements, gain

FACTORS = st.complex_numbers(max_magnitude=100.0)


def everywhere(seed, count=50):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(count) + 1j * rng.standard_normal(count)


@given(FACTORS, FACTORS, st.integers(0, 1000))
def test_both_factors_come_back_from_what_they_make(kept, mirrored, seed):
    called_for = everywhere(seed)
    fit = fit_displacements(kept * called_for + mirrored * np.conj(called_for), called_for)
    assert fit.kept == pytest.approx(kept, abs=1e-9)
    assert fit.mirrored == pytest.approx(mirrored, abs=1e-9)


@pytest.mark.parametrize(
    ("frame", "kept", "mirrored"),
    [
        (lambda x1, x2: (x1, x2), 1.0, 0.0),
        (lambda x1, x2: (-x1, -x2), -1.0, 0.0),
        (lambda x1, x2: (-x2, x1), 1j, 0.0),
        (lambda x1, x2: (x1, -x2), 0.0, 1.0),
        (lambda x1, x2: (x2, x1), 0.0, 1j),
        (lambda x1, x2: (-x1, x2), 0.0, -1.0),
        (lambda x1, x2: (1e3 * x1, 1e3 * x2), 1e3, 0.0),
    ],
    ids=["right", "backwards", "quarter", "x2 mirrored", "exchanged", "x1 mirrored", "mm"],
)
def test_each_frame_leaves_the_mark_that_the_docstring_says(frame, kept, mirrored):
    called_for = everywhere(1)
    x1, x2 = frame(called_for.real, called_for.imag)
    fit = fit_displacements(x1 + 1j * x2, called_for)
    assert fit.kept == pytest.approx(kept, abs=1e-9)
    assert fit.mirrored == pytest.approx(mirrored, abs=1e-9)


@given(FACTORS, st.floats(0.0, 2.0 * np.pi))
def test_along_one_line_nothing_is_said_of_a_mirror(kept, angle):
    called_for = np.linspace(-1.0, 1.0, 20) * np.exp(1j * angle)
    fit = fit_displacements(kept * called_for, called_for)
    assert fit.kept == pytest.approx(kept, abs=1e-9)
    assert fit.mirrored == 0.0


def test_of_no_motion_nothing_is_said():
    assert fit_displacements(np.ones(3, complex), np.zeros(3, complex)) == (0.0, 0.0)
    assert gain(np.ones(3), np.zeros(3)) is None


@given(st.floats(-50.0, 50.0), st.integers(0, 100))
def test_a_gain_is_the_factor(factor, seed):
    called_for = np.random.default_rng(seed).standard_normal(9)
    assume(float(called_for @ called_for) > 1e-3)
    assert gain(factor * called_for, called_for) == pytest.approx(factor, abs=1e-9)
