"""The controller as a person uses it in Python: its settings, one step, a closed loop, pictures."""

from dataclasses import replace

import numpy as np
import pytest
from prediction_models import exact_d5t

import koopman_lab as kl
from koopman_lab.errors import ArgumentError, ConfigError, ModelError
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.studies.closed_loop import closed_loop

EXACT = kl.Model(exact_d5t())
START = [-0.2, 0.1, 0.3]
QUICK = {"horizon": 15, "use_compiler": False}


@pytest.fixture(scope="module")
def controller():
    return kl.Controller(EXACT, **QUICK)


def test_a_closed_loop_is_that_of_the_studies(controller):
    run = controller.simulate(START, 1.0)
    expected = closed_loop(controller.config, KoopmanPrediction(EXACT.learned), START, 1.0)
    np.testing.assert_array_equal(run.states, expected.states)
    assert repr(run).startswith("Run(20 steps in 1 s, from (-0.2, 0.1, 0.3) to (")
    assert repr(run).endswith("0 unsolved)")


def test_one_step_after_the_other_is_the_same_drive(controller):
    run = controller.simulate(START, 0.5)
    controller.restart()
    for x, u in zip(run.states, run.inputs, strict=False):
        decision = controller.step(x)
        np.testing.assert_array_equal(decision.u, u)
    assert decision.plan.states.shape == (16, 3)
    assert repr(decision).startswith("Decision(u = (")
    other = [1.0, 1.0, 1.0]
    assert controller.simulate(other, 0.05).inputs[0] == pytest.approx(
        kl.Controller(EXACT, **QUICK).step(other).u
    ), "a simulation depends on no step before it"


def test_without_a_model_it_plans_with_the_nominal_equations():
    dynamic = kl.Controller(robot="dynamic", **QUICK)
    run = dynamic.simulate(START, 0.2)
    assert run.states[0].tolist() == [*START, 0.0, 0.0], "a pose is a state at rest"
    nominal = NominalPrediction("dynamic", dynamic.dt_s)
    expected = closed_loop(dynamic.config, nominal, run.states[0], 0.2)
    np.testing.assert_array_equal(run.states, expected.states)
    assert "dynamic robot, cost me, plans with the nominal equations, 15 steps" in repr(dynamic)


def test_settings_are_those_of_the_configuration(tmp_path):
    weights = {"ce": {"q": np.array([1.0, 1e-6, 3.0]), "r": (4.0, 5.0)}}
    chosen = kl.Controller(EXACT, cost="ce", weights=weights, reprojection=False, **QUICK)
    settings = chosen.config.controller
    assert (settings.cost, settings.horizon, settings.reprojection) == ("ce", 15, False)
    assert settings.weights["ce"].q == (1.0, 1e-6, 3.0)
    assert chosen.stage_cost([1.0, 0.0, 2.0], [0.0, 1.0]) == pytest.approx(1.0 + 12.0 + 5.0)
    file = tmp_path / "lab.yaml"
    file.write_text("controller: {cost: ce, horizon: 9, use_compiler: false}\n")
    for config in (file, str(file), kl.load_config(str(file))):
        read = kl.Controller(EXACT, config).config
        assert (read.controller.cost, read.controller.horizon) == ("ce", 9)
        assert kl.Controller(EXACT, config, horizon=12).config.controller.horizon == 12


def test_a_model_may_be_its_file(tmp_path):
    EXACT.save(tmp_path / "model.npz")
    for file in (tmp_path / "model.npz", str(tmp_path / "model.npz")):
        read = kl.Controller(file, **QUICK)
        np.testing.assert_array_equal(
            read.step(START).u, kl.Controller(EXACT, **QUICK).step(START).u
        )


def test_the_sampling_time_is_the_models_unless_somebody_says_another():
    slower = kl.Model(exact_d5t(0.1))
    assert kl.Controller(slower, **QUICK).dt_s == 0.1
    with pytest.raises(ModelError, match=r"sampling time of 0\.1 s, but controller\.dt_s is 0\.05"):
        kl.Controller(slower, dt_s=0.05, **QUICK)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"horizn": 40}, r"settings: controller\.horizn: .*did you mean controller\.horizon"),
        ({"horizon": "many"}, r"settings: controller\.horizon: .*'many'"),
        ({"cost": "free"}, r"settings: controller\.cost: .*'free'"),
        ({"weights": {"me": {"q": [1.0], "r": [1.0, 1.0]}}}, "3 states .*found 1 weights"),
        ({"robot": "tractor"}, "unknown robot 'tractor'"),
        ({"config": "nowhere.yaml"}, "nowhere.yaml"),
    ],
)
def test_a_setting_that_is_none_is_refused_in_words(settings, said):
    with pytest.raises(ConfigError, match=said):
        kl.Controller(None, **settings)
    if "config" not in settings and "robot" not in settings:
        with pytest.raises(ConfigError, match=said):
            kl.Controller(None, kl.load_config(), **settings)


def test_a_robot_that_is_not_the_configurations_is_refused():
    with pytest.raises(ConfigError, match="of the kinematic robot, not of the dynamic one"):
        kl.Controller(None, kl.load_config(), robot="dynamic")
    with pytest.raises(ModelError, match="of the kinematic robot, the lab is set up"):
        kl.Controller(EXACT, robot="dynamic")


def test_a_model_that_drives_the_wrong_way_is_refused_unless_somebody_wants_to_see_it():
    m0, *others = EXACT.learned.matrices
    backward = kl.Model(
        replace(EXACT.learned, matrices=np.array([m0, *(np.linalg.inv(m) for m in others)]))
    )
    with pytest.raises(ModelError, match="must not drive a robot"):
        kl.Controller(backward, **QUICK)
    run = kl.Controller(backward, judge=False, **QUICK).simulate([0.3, 0.0, 0.0], 1.0)
    assert abs(run.states[-1, 0]) > 0.3


@pytest.mark.parametrize("x", [[0.0, 0.0], [0.0] * 4, [[0.0] * 3], 0.0])
def test_what_is_no_state_is_refused_with_both_numbers(controller, x):
    shape = np.shape(x)
    for refuse in (
        controller.step,
        controller.simulate,
        lambda x: controller.stage_cost(x, (0, 0)),
    ):
        with pytest.raises(ArgumentError) as refused:
            refuse(x)
        assert f"shape {shape}, expected (3,)" in str(refused.value)


@pytest.mark.parametrize("duration_s", [0.0, -1.0, 0.04, float("nan"), float("inf")])
def test_a_time_shorter_than_a_step_or_endless_is_refused(controller, duration_s):
    with pytest.raises(ArgumentError, match=r"duration_s: .* at least one sampling time, 0\.05 s"):
        controller.simulate(START, duration_s)


@pytest.mark.parametrize("ending", ["", ".png", ".pdf"])
def test_a_picture_is_two_files_that_a_notebook_shows(controller, ending, tmp_path):
    runs = {"a": controller.simulate(START, 0.5), "b": controller.simulate([0.1, 0.1, 0.0], 0.5)}
    for shown in (runs, runs["a"]):
        picture = kl.plot_paths(shown, f"{tmp_path}/paths{ending}")
        assert (picture.png, picture.pdf) == (tmp_path / "paths.png", tmp_path / "paths.pdf")
        assert picture.pdf.read_bytes().startswith(b"%PDF")
        assert picture._repr_png_().startswith(b"\x89PNG")


def test_nothing_makes_no_picture(tmp_path):
    with pytest.raises(ArgumentError, match="runs: 0 of them, expected at least 1"):
        kl.plot_paths({}, tmp_path / "paths")
    with pytest.raises(ArgumentError, match="validations: 0 of them, expected at least 1"):
        kl.plot_validation([], tmp_path / "errors")
    with pytest.raises(ArgumentError, match="models: 0 of them, expected at least 1"):
        kl.validate({}, tmp_path)
    with pytest.raises(ArgumentError, match="steps: 0, expected at least 1"):
        kl.validate(EXACT, tmp_path, steps=0)
