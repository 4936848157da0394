"""The grid of weights and bounds."""

import csv

import numpy as np
import pytest
from prediction_models import exact_d5t

from koopman_lab.config.load import load_config
from koopman_lab.files import write_csv
from koopman_lab.koopman.dictionary import dictionary
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.studies import weights
from koopman_lab.studies.weights import Setting


def test_a_grid_has_every_combination_and_the_bounds_alone():
    grid = weights.settings(["me", "ds"])
    assert len(grid) == len(set(grid)) == 2 * (3**4 + 2)
    assert Setting("ds", (0.1, 10.0, 1.0, 1.0)) in grid
    assert Setting("me", (1.0, 1.0, 1.0, 1.0), 0.5) in grid


@pytest.mark.parametrize(
    ("name", "kind", "groups"),
    [
        ("D5t", "kinematic", ["", "x1", "x2", "angle", "angle"]),
        ("D8Eul", "dynamic", ["", "x1", "x2", "angle", "", "", "", ""]),
        ("D13t", "dynamic", ["", "x1", "x2", "angle", "angle", *[""] * 6, "angle", "angle"]),
    ],
)
def test_each_observable_belongs_to_the_group_of_what_it_is_made_of(name, kind, groups):
    assert [weights.group_of(n) for n in dictionary(name, kind).names] == groups


def test_a_setting_multiplies_weights_and_bounds():
    d5t = dictionary("D5t", "kinematic")
    config = load_config(robot="kinematic", overrides=["controller.weights.ds.q=[2.0]"])
    before = config.controller
    applied = weights.apply(config, Setting("ce", (10.0, 0.1, 2.0, 3.0), 0.5), d5t).controller
    assert applied.cost == "ce"
    old, new = before.weights["ce"], applied.weights["ce"]
    np.testing.assert_allclose(new.q, np.array(old.q) * [10.0, 0.1, 2.0])
    np.testing.assert_allclose(new.r, 3.0 * np.array(old.r))
    np.testing.assert_allclose(applied.u_max, 0.5 * np.array(before.u_max))
    assert applied.weights["me"] == before.weights["me"]
    spread = weights.apply(config, Setting("ds", (10.0, 0.1, 2.0, 1.0)), d5t).controller
    np.testing.assert_allclose(spread.weights["ds"].q, [2.0, 20.0, 0.2, 4.0, 4.0])


def test_the_table_has_a_line_for_each_run_and_the_summary_each_cost(tmp_path):
    overrides = ["controller.horizon=10"]
    config, model = load_config(robot="kinematic", overrides=overrides), exact_d5t()
    grid = weights.settings(["me", "ce"], [1.0])
    rows = list(
        weights.study(config, KoopmanPrediction(model), np.array([-0.2, 0.05, 0.0]), 1.0, grid)
    )
    write_csv(tmp_path / "table.csv", *weights.as_table(rows))
    with (tmp_path / "table.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["cost"] for line in lines] == ["me"] * 3 + ["ce"] * 3
    assert [float(line["factor_bounds"]) for line in lines] == [1.0, 0.5, 2.0] * 2
    found = weights.summary(rows)
    assert found["me"]["configured_mm"] == pytest.approx(float(lines[0]["x2_last_mm"]))
    assert found["ce"]["worst_mm"] >= found["ce"]["median_mm"] >= found["ce"]["best_mm"]
