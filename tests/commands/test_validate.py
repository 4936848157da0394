"""`klab reference` and `klab validate`: from a driven shape to the errors of a model."""

import json
from dataclasses import asdict

import pytest
from klab import MODEL, REFERENCE, klab_json, klab_ok

import koopman_lab as kl
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError
from offboard.commands.data.figure import multistep
from offboard.commands.data.validation_inputs import models_and_runs


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "infinity"
    shape = ("--shape", "infinity", "--runs", "2", "--set", "reference.infinity.lap_s=8")
    klab_ok("reference", *shape, "--lockstep", "--seed", "3", "--out", folder)
    return folder


def test_a_session_says_what_was_driven(runs):
    summary = json.loads((runs / "summary.json").read_text())
    assert (summary["what"], summary["shape"]) == ("reference", "infinity")
    assert (summary["runs"], summary["runs_wanted"], summary["complete"]) == (2, 2, True)
    assert summary["repeated"] == {}
    # The lap, and one second each to reach the speed and to stop.
    assert summary["steps"] == (8 + 2) * 20


def test_models_are_measured_beside_the_nominal_one(runs, tmp_path):
    facts = klab_json("validate", MODEL, runs, "--steps", "20", "--out", tmp_path)
    surrogate, without, nominal = facts["validations"]
    assert [v["reprojection"] for v in (surrogate, without, nominal)] == [True, False, None]
    assert (surrogate["dictionary"], nominal["model"]) == ("D5t", "nominal")
    for v in (surrogate, without, nominal):
        assert [e["steps"] for e in v["errors"]] == list(range(1, 21))
        assert v["runs"] == 2
        # Every frame of 10 s twice, but those that lost frames and the last second take away.
        assert 3500 < v["errors"][-1]["starts"] < v["errors"][0]["starts"] < 2 * 10 * 240
    first, last = surrogate["errors"][0], surrogate["errors"][-1]
    assert first["position_max_m"] < 0.003
    assert first["position_mean_m"] < last["position_mean_m"] < last["position_max_m"] < 0.02
    assert without["errors"][-1]["position_mean_m"] > last["position_mean_m"]
    assert {p.name for p in tmp_path.iterdir()} == {
        f"validation.{e}" for e in ("csv", "pdf", "png")
    }
    lines = (tmp_path / "validation.csv").read_text().splitlines()
    assert len(lines) == 1 + 3 * 20
    in_python = kl.validate({MODEL.stem: MODEL}, str(runs), steps=20)
    assert [json.loads(json.dumps(asdict(v))) for v in in_python] == facts["validations"]
    assert repr(in_python[0]).startswith(
        "Validation(model on 2 runs, infinity: mean errors 1 ahead"
    )
    (by_its_own_name, *_) = kl.validate(str(MODEL), runs, steps=1)
    assert by_its_own_name.model == "D5t"
    picture = kl.plot_validation(in_python, tmp_path / "again.pdf")
    numbers = picture.png.with_suffix(".csv").read_text()
    assert numbers.splitlines() == lines


def test_what_does_not_fit_is_refused_in_words(runs):
    park = REFERENCE / "park.lcm"
    with pytest.raises(DataError, match=r"reference runs, which are for `klab validate`"):
        DataSet.from_log(runs)
    with pytest.raises(DataError, match=r"model\.npz: no reference run .*`klab reference`"):
        models_and_runs([MODEL], None, salvage=False)
    with pytest.raises(DataError, match=r"no model .*`klab train`"):
        models_and_runs([runs], None, salvage=False)
    with pytest.raises(
        DataError, match=r"park\.lcm, R1_REFERENCE_STATE: no complete reference run"
    ):
        models_and_runs([MODEL, park], None, salvage=False)


def test_the_figures_of_the_kinematic_robot_have_no_velocities(runs, tmp_path):
    multistep([MODEL, runs], tmp_path / "steps", steps=2)
    head = (tmp_path / "steps.csv").read_text().splitlines()[0]
    assert head.endswith("mean_position_m,mean_angle_rad,largest_position_m,largest_angle_rad")
    assert {p.name for p in tmp_path.iterdir()} == {"steps.pdf", "steps.png", "steps.csv"}
    with pytest.raises(DataError, match="of one model on one session"):
        multistep([MODEL, runs, runs / "session.lcm"], tmp_path / "no", steps=2)
