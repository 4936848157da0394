"""The figures of section 5.3 come with their numbers."""

import csv
from pathlib import Path

import numpy as np
import pytest
from ideal_data import ideal_dataset
from nominal_runs import DT_S, run

from koopman_lab.config.load import load_config
from koopman_lab.data.reference_trajectories import ReferenceRuns
from koopman_lab.figures.dictionaries_figure import draw_dictionaries, open_loop
from koopman_lab.figures.multistep_figure import draw_multi_step, multi_step
from koopman_lab.geometry.planar import ORIGIN
from koopman_lab.koopman.trainer import train

STEPS = 30


@pytest.fixture(scope="module")
def runs():
    driven = [run(steps=STEPS, number=number) for number in (0, 1)]
    config = load_config(robot="dynamic")
    return ReferenceRuns(Path("a.lcm"), config, "square", 40, 2, driven[0].x[0], lambda _: driven)


@pytest.fixture(scope="module")
def models():
    dataset = ideal_dataset("dynamic", segments=12)
    return {name: train(dataset, name)[0] for name in ("D8Eul", "D10m")}


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_open_loop_predictions_of_models_beside_the_nominal_path(runs, models, tmp_path):
    found = open_loop(models, runs)
    assert list(found) == ["D8Eul", "D10m", "nominal"]
    driven = runs.trajectories(ORIGIN)[0].x[::12]
    assert np.abs(found["nominal"].path[:-1] - driven).max() < 1e-9
    worst = {name: of.one_step[:, 0].max() for name, of in found.items()}
    assert worst["nominal"] < worst["D8Eul"] < worst["D10m"]
    draw_dictionaries(tmp_path / "open", models, [runs])
    names = {"open.pdf", "open.png", "open-paths.csv", "open-one-step.csv"}
    assert {p.name for p in tmp_path.iterdir()} == names
    paths = rows(tmp_path / "open-paths.csv")
    assert len(paths) == 4 * (STEPS + 1)
    mean = np.mean([run.x[::12, 0] for run in runs.trajectories(ORIGIN)], axis=0)
    written = [float(row["x1_m"]) for row in paths if row["model"] == "driven"]
    assert np.abs(np.array(written[: len(mean)]) - mean).max() < 1e-9
    assert float(paths[-1]["x1_m"]) == found["nominal"].path[-1, 0]
    one_step = rows(tmp_path / "open-one-step.csv")
    assert {row["model"] for row in one_step} == set(found)
    assert float(one_step[-1]["time_s"]) <= STEPS * DT_S


def test_multi_step_errors_along_the_runs(runs, models, tmp_path):
    found = multi_step("D8Eul", models["D8Eul"], runs, 5)
    assert list(found) == ["D8Eul", "D8Eul, no reprojection", "nominal"]
    for of in found.values():
        assert of.mean.shape == of.largest.shape == (len(of.time_s), 5, 4)
        known = np.isfinite(of.mean)
        assert (of.largest[known] >= of.mean[known]).all()
    surrogate, without, _ = found.values()
    assert np.array_equal(surrogate.mean[:, 0], without.mean[:, 0])
    assert np.nanmax(without.mean[:, 4, 0]) > np.nanmax(surrogate.mean[:, 4, 0])
    draw_multi_step(tmp_path / "steps", found, "2 runs")
    assert {p.name for p in tmp_path.iterdir()} == {"steps.pdf", "steps.png", "steps.csv"}
    table = rows(tmp_path / "steps.csv")
    assert {row["predictor"] for row in table} == set(found)
    assert {row["steps"] for row in table} == {"1", "2", "3", "4", "5"}
