"""Claims read their numbers from what the steps leave, and say which verdict follows."""

import csv
import json
import re

import pytest

from koopman_lab.errors import DataError
from offboard.reproduction.paper.claim import judge
from offboard.reproduction.paper.claims import CLAIMS
from offboard.reproduction.paper.settings import SETTINGS
from offboard.reproduction.paper.step_results import StepResults
from offboard.reproduction.paper.verdict import Verdict

BY_NAME = {claim.name: claim for claim in (*CLAIMS, *SETTINGS)}


def leave_study(folder, ends_mm, failed=()):
    """Write the rows of a study: |x2| in mm by case; numbers in ``failed`` are runs without end."""
    folder.mkdir()
    with (folder / "rows.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("case", "index", "x2_m", "reason"))
        for case, ends in ends_mm.items():
            for index, end in enumerate(ends):
                lost = index in failed
                writer.writerow(
                    (case, index, "" if lost else -1e-3 * end, "unsolved" if lost else "")
                )


def leave_summary(folder, **facts):
    folder.mkdir()
    (folder / "summary.json").write_text(json.dumps(facts))


@pytest.mark.parametrize(
    ("ends_mm", "verdict"),
    [
        ([0.5, 1.0, 1.9, 500.0], Verdict.HOLDS),
        ([0.5, 1.0, 3.9, 500.0], Verdict.WEAKER),
        ([0.5, 1.0, 4.1, 500.0], Verdict.NOT),
    ],
)
def test_75_percent_of_the_second_order_starts(tmp_path, ends_mm, verdict):
    leave_study(tmp_path / "dynamic-parking", {"me-reprojected": ends_mm})
    judged = judge(BY_NAME["dynamic-mixed-reliable"], StepResults(tmp_path))
    assert judged.verdict is verdict
    assert judged.steps == ("dynamic-parking",)


def test_a_run_that_failed_counts_as_one_that_did_not_arrive(tmp_path):
    ends = [0.1, 0.1, 0.1, 0.1]
    leave_study(tmp_path / "dynamic-parking", {"me-reprojected": ends}, failed=(0, 1))
    judged = judge(BY_NAME["dynamic-mixed-reliable"], StepResults(tmp_path))
    assert judged.verdict is Verdict.NOT
    assert "inf mm" in judged.numbers[0]


@pytest.mark.parametrize(
    ("ce_mm", "verdict"),
    [
        ([1.1, 1.1, 0.9, 0.9], Verdict.HOLDS),
        ([1.1, 0.9, 0.9, 0.9], Verdict.WEAKER),
        ([0.9, 0.9, 0.9, 0.9], Verdict.NOT),
    ],
)
def test_quadratic_costs_fail_in_most_cases_each_of_them(tmp_path, ce_mm, verdict):
    ends = {name: [5.0] * 4 for name in ("ce-lifted", "ds-reprojected", "ds-lifted")} | {
        "ce-reprojected": ce_mm
    }
    leave_study(tmp_path / "kinematic-parking", ends)
    judged = judge(BY_NAME["kinematic-quadratic-fail"], StepResults(tmp_path))
    assert judged.verdict is verdict
    assert judged.weakest.startswith("ce-reprojected")


@pytest.mark.parametrize(
    ("few", "verdict"),
    [(96, Verdict.HOLDS), (90, Verdict.WEAKER), (80, Verdict.NOT)],
)
def test_ten_samples_suffice_when_as_many_runs_arrive_as_with_all(tmp_path, few, verdict):
    ends = {
        "kinematic-all": [0.1] * 100,
        "kinematic-d10": [0.1] * few + [50.0] * (100 - few),
    }
    leave_study(tmp_path / "data-efficiency", ends)
    assert judge(BY_NAME["kinematic-few-samples"], StepResults(tmp_path)).verdict is verdict


@pytest.mark.parametrize(
    ("x2_mm", "verdict"),
    [(0.029, Verdict.HOLDS), (0.031, Verdict.WEAKER), (0.31, Verdict.NOT)],
)
def test_all_three_models_park_in_simulation(tmp_path, x2_mm, verdict):
    controllers = {
        "me-reprojected": {"x2_mm": 0.001},
        "me-lifted": {"x2_mm": x2_mm},
        "me-nominal": {"x2_mm": 0.0},
    }
    leave_summary(tmp_path / "simulation-models", controllers=controllers)
    judged = judge(BY_NAME["models-park"], StepResults(tmp_path))
    assert judged.verdict is verdict
    assert judged.numbers[1] == f"me-lifted: {x2_mm:g} mm"


@pytest.mark.parametrize(
    ("largest", "verdict"),
    [((0.049, 0.13), Verdict.HOLDS), ((0.051, 0.13), Verdict.WEAKER), ((0.049, 0.22), Verdict.NOT)],
)
def test_the_largest_error_of_all_starts_counts(tmp_path, largest, verdict):
    (tmp_path / "multistep").mkdir()
    rows = ["predictor,steps,time_s,largest_position_m,largest_angle_rad"]
    rows += ["D8Eul,20,0.0,0.001,0.001", f"D8Eul,20,0.5,{largest[0]},{largest[1]}"]
    # Of other predictors and steps, which are not meant.
    rows += ["D8Eul,1,0.0,9.0,9.0", "nominal,20,0.0,9.0,9.0"]
    (tmp_path / "multistep" / "multistep.csv").write_text("\n".join(rows))
    assert judge(BY_NAME["largest-errors"], StepResults(tmp_path)).verdict is verdict


def test_a_missing_number_is_no_verdict_and_says_where_it_is_missing(tmp_path):
    judged = judge(BY_NAME["dynamic-mixed-reliable"], StepResults(tmp_path))
    assert judged.verdict is Verdict.UNKNOWN
    assert "dynamic-parking/rows.csv" in judged.numbers[0]
    leave_study(tmp_path / "dynamic-parking", {"ce-lifted": [1.0]})
    judged = judge(BY_NAME["dynamic-mixed-reliable"], StepResults(tmp_path))
    assert judged.verdict is Verdict.UNKNOWN
    assert "case me-reprojected" in judged.numbers[0]


def test_settings_are_read_from_the_configuration_of_the_step(tmp_path):
    place = tmp_path / "simulation-models"
    place.mkdir()
    (place / "config.yaml").write_text("controller: {horizon: 60, dt_s: 0.05}")
    found = StepResults(tmp_path)
    assert judge(BY_NAME["simulation-horizon"], found).verdict is Verdict.HOLDS
    assert judge(BY_NAME["simulation-dt"], found).verdict is Verdict.NOT
    with pytest.raises(DataError, match=r"controller\.cost"):
        found.config("simulation-models", "controller", "cost")


def test_names_are_unique_and_every_claim_has_what_the_report_shows():
    assert len(BY_NAME) == len(CLAIMS) + len(SETTINGS)
    for claim in BY_NAME.values():
        assert re.fullmatch(r"[a-z0-9-]+", claim.name)
        assert claim.parts
        assert claim.paper
        assert re.fullmatch(r"4|5(\.[1-4])?|6", claim.section)
