"""The studies from random starts: the same table whoever ran what, and after an interruption."""

import json
from pathlib import Path

import numpy as np
import pytest

from koopman_lab.config.load import load_config
from koopman_lab.errors import DataError
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.studies import parking
from koopman_lab.studies.pools import Processes
from koopman_lab.studies.runner import Study, run_study

MODEL = Path(__file__).parents[1] / "data" / "reference" / "model.npz"
ONE = Processes(1)


def tiny(*overrides: str) -> list[parking.Case]:
    wanted = ("controller.horizon=5", "controller.use_compiler=false", *overrides)
    lab = load_config(robot="kinematic", overrides=wanted)
    made = parking.cases(lab, MODEL.read_bytes(), 0.2)
    return [case for case in made if case.label in ("ds-lifted", "me-nominal")]


def test_all_controllers_meet_the_same_starts():
    one, other = tiny()
    rows = [parking.run(case, 2) for case in (one, other)]
    starts = [[row[name] for name in parking.COLUMNS[2:5]] for row in rows]
    assert starts[0] == starts[1] == parking.start(one.config, 2).tolist()
    assert rows[0]["reason"] is rows[1]["reason"] is None
    children = np.random.SeedSequence(one.config.seed).spawn(3)
    low, high = np.array(KINEMATIC.runs.random_starts).T
    assert starts[0] == np.random.default_rng(children[2]).uniform(low, high).tolist()


def test_a_failing_run_is_a_row_with_its_reason():
    row = parking.run(tiny("controller.dt_s=0.1")[0], 0)
    assert "sampling time" in row["reason"]
    assert row["x2_m"] is None


def test_workers_chunks_and_interruptions_leave_no_trace(tmp_path):
    study = Study("tiny", tiny(), 3)
    run_study(tmp_path / "one", study, ONE)
    table = (tmp_path / "one" / "rows.csv").read_bytes()
    assert len(table.splitlines()) == 7
    run_study(tmp_path / "two", study, Processes(2), chunk=1)
    assert (tmp_path / "two" / "rows.csv").read_bytes() == table
    rows = tmp_path / "one" / "rows.jsonl"
    rows.write_bytes(rows.read_bytes()[:-300])
    assert not rows.read_bytes().endswith(b"\n")
    (tmp_path / "one" / "rows.csv").unlink()
    run_study(tmp_path / "one", study, ONE, resume=True)
    assert (tmp_path / "one" / "rows.csv").read_bytes() == table
    assert len(rows.read_bytes().splitlines()) == 6
    one, two = (json.loads((tmp_path / n / "study.json").read_text()) for n in ("one", "two"))
    assert one == two


def test_another_study_is_not_mixed_in(tmp_path):
    run_study(tmp_path, Study("tiny", tiny()[:1], 1), ONE)
    with pytest.raises(DataError, match="--resume"):
        run_study(tmp_path, Study("tiny", tiny()[:1], 1), ONE)
    with pytest.raises(DataError, match="other settings"):
        run_study(tmp_path, Study("tiny", tiny("seed=5")[:1], 1), ONE, resume=True)
