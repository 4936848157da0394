"""What the smoothing window does to a fit, on sessions of a known robot."""

import csv

import numpy as np
import pytest
from synthetic_session import Session

from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import DataError
from koopman_lab.evaluation.window_sweep import known_entries, sweep
from koopman_lab.figures.window_sweep_figure import draw_sweep

NOISE_RAD = 2e-4


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    """Return the log of a session whose cameras see the angle with noise."""
    session = Session("dynamic", segments=6, run_s=1.5)
    rng = np.random.default_rng(5)
    for frame in session.frames:
        frame.theta_rad += NOISE_RAD * rng.normal()
    return SessionLog(session.write(tmp_path_factory.mktemp("noisy") / "session.lcm"))


@pytest.fixture(scope="module")
def rows(noisy):
    return list(sweep(noisy, [1, 20, 40, 2000], "D8Eul"))


def test_the_window_brings_the_integrator_back(rows):
    """Noise in omega takes from the entries it multiplies, the average gives them back."""
    integrators = [abs(row.entries["M_0[omega,omega]"] - 1.0) for row in rows[:3]]
    assert integrators[0] > 0.05
    assert integrators[0] > 10.0 * integrators[1]
    assert integrators[1] > integrators[2]
    assert rows[2].entries["M_0[theta,omega]"] == pytest.approx(0.05, rel=1e-2)
    assert rows[2].entries["M_1[v,1]"] == pytest.approx(0.01, abs=1e-3)
    assert rows[2].entries["M_2[omega,1]"] == pytest.approx(0.025, abs=3e-3)


def test_errors_on_runs_that_were_held_out_shrink_with_the_window(rows):
    unsmoothed, smoothed = rows[0], rows[2]
    assert (smoothed.one_step.steps, smoothed.multi_step.steps) == (1, 20)
    assert smoothed.multi_step.angle_mean_rad < 0.2 * unsmoothed.multi_step.angle_mean_rad
    assert smoothed.one_step.starts == unsmoothed.one_step.starts
    assert unsmoothed.pairs > smoothed.pairs > 0
    assert smoothed.constant_residual < 1e-9


def test_a_window_that_leaves_nothing_is_told_and_stops_nothing(rows):
    last = rows[-1]
    assert "no samples" in last.refused
    assert (last.pairs, last.entries, last.multi_step) == (0, None, None)


def test_instruments_bring_the_integrator_back_without_a_window(noisy, rows):
    (iv,) = sweep(noisy, [1], "D8Eul", ["iv"])
    assert (iv.estimator, iv.pairs) == ("iv", rows[0].pairs)
    off = abs(iv.entries["M_0[omega,omega]"] - 1.0)
    assert off < 0.2 * abs(rows[0].entries["M_0[omega,omega]"] - 1.0)


def test_only_entries_that_the_dictionary_has_are_looked_at(noisy):
    config = noisy.config()
    names = [e.name for e in known_entries(config, ("1", "v", "omega", "sin(theta)"))]
    assert names == ["M_0[v,v]", "M_0[omega,omega]", "M_1[v,1]", "M_2[omega,1]"]


def test_the_kinematic_robot_has_no_velocities_to_smooth(tmp_path):
    log = SessionLog(Session("kinematic", segments=1).write(tmp_path / "session.lcm"))
    with pytest.raises(DataError, match=r"session\.lcm: the kinematic robot .* --robot dynamic"):
        next(sweep(log, [10], "D5t"))


def test_the_figure_comes_with_its_numbers(noisy, rows, tmp_path):
    entries = known_entries(noisy.config(), ("1", "theta", "v", "omega"))
    draw_sweep(tmp_path / "sweep", rows, entries)
    assert {p.name for p in tmp_path.iterdir()} == {"sweep.pdf", "sweep.png", "sweep.csv"}
    with (tmp_path / "sweep.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["window"] for line in lines] == ["1", "20", "40", "2000"]
    for line, row in zip(lines[:3], rows, strict=False):
        assert float(line["M_0[omega,omega]"]) == row.entries["M_0[omega,omega]"]
        assert float(line["position_mean_m_20_steps"]) == row.multi_step.position_mean_m
    assert lines[3]["condition"] == ""
    assert "no samples" in lines[3]["refused"]
