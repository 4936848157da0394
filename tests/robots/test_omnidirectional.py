"""A kind of robot that the product does not know, described by the tests and nowhere else.

It stands on three wheels that roll in any direction, so that its inputs are all three velocities of
its body: 3 states and 3 inputs. It goes the whole way from the description to the compiled
controller without a change of the product.
"""

import numpy as np
import pytest
from ideal_data import ideal_dataset
from nominal_runs import DT_S, run
from omnidirectional import BASIS, EXPRESSIONS, KIND, OMNIDIRECTIONAL
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from synthetic_session import Session

from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import ConfigError, DataError, ModelError
from koopman_lab.evaluation.describe import describe
from koopman_lab.evaluation.heldout import errors, held_out_runs, split
from koopman_lab.evaluation.metrics import by_model, by_nominal, per_step, rolling_deviations
from koopman_lab.evaluation.trajectory_starts import starts_along
from koopman_lab.koopman import dictionary as dictionaries
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.dictionary import dictionary, from_expressions
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.mpc.configured_cost import stage_cost
from koopman_lab.mpc.solver import make_solver
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from koopman_lab.predictors.lifted import LiftedPrediction
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.table import ROBOTS, robot_type
from koopman_lab.studies.closed_loop import as_rows, closed_loop, columns

U_MAX, HORIZON = (0.4, 0.4, 1.5), 10
X0 = np.array([0.6, -0.4, 2.0])


@pytest.fixture(autouse=True)
def registered():
    ROBOTS.register(KIND, OMNIDIRECTIONAL)
    yield
    ROBOTS.unregister(KIND)


@pytest.fixture
def dataset():
    return ideal_dataset(KIND)


@pytest.fixture
def model(dataset):
    return train(dataset, ", ".join(EXPRESSIONS), Method(combination="generator"))[0]


@pytest.fixture
def affine(dataset):
    """Combine the matrices as the paper does, which takes less code to compile."""
    return train(dataset, ", ".join(EXPRESSIONS))[0]


def propagation(u, dt_s=DT_S):
    """Return M_u: the Lie derivatives along an input map the span of the dictionary to itself."""
    ahead, aside, omega = u
    generator = np.zeros((5, 5))
    generator[1, 3:] = ahead, -aside
    generator[2, 3:] = aside, ahead
    generator[3, 4], generator[4, 3] = -omega, omega
    return expm(dt_s * generator)


def lab(cost="me", *overrides):
    """Return a configuration of the robot."""
    return load_config(robot=KIND, overrides=[f"controller.cost={cost}", *overrides])


def test_the_description_solves_the_equations():
    u = np.array([0.3, -0.2, 1.1])
    exact = solve_ivp(
        lambda _, x: [
            u[0] * np.cos(x[2]) - u[1] * np.sin(x[2]),
            u[0] * np.sin(x[2]) + u[1] * np.cos(x[2]),
            u[2],
        ],
        (0.0, 0.1),
        X0,
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    assert robot_type(KIND).step(X0, u, 0.1) == pytest.approx(exact, abs=1e-11)


def test_a_dictionary_is_of_its_states():
    own = dictionary(", ".join(EXPRESSIONS), KIND)
    assert (own.robot, own.state_dim) == (OMNIDIRECTIONAL, 3)
    with pytest.raises(ModelError, match=r"D5t.*for the kinematic robot.*omnidirectional robot"):
        dictionary("D5t", KIND)
    with pytest.raises(ModelError, match="there is no 'v'"):
        dictionary("1, x1, x2, theta, v", KIND)


def test_data_of_another_number_of_inputs_are_refused(dataset):
    with pytest.raises(DataError, match=r"basis_inputs of basis input 1 has shape \(2,\).*\(3,\)"):
        DataSet(
            **{name: getattr(dataset, name) for name in ("X", "Y", "segments", "start_us")},
            basis_inputs={i: u[:2] for i, u in dataset.basis_inputs.items()},
            dt_s=dataset.dt_s,
            robot_kind=KIND,
            metadata={},
        )


@pytest.mark.parametrize("combination", ["paper", "generator"])
def test_the_fit_is_that_of_the_lie_derivatives(dataset, combination):
    model, report = train(dataset, ", ".join(EXPRESSIONS), Method(combination=combination))
    assert model.matrices.shape == (4, 5, 5)
    np.testing.assert_array_equal(model.matrices[0], np.eye(5))
    for matrix, u in zip(model.matrices, model.basis_inputs, strict=True):
        np.testing.assert_allclose(matrix, propagation(u), atol=1e-11)
    np.testing.assert_allclose(model.basis_inputs, [(0.0, 0.0, 0.0), *BASIS.values()])
    assert report.robot == KIND
    assert report.defects is None


def test_a_recorded_session_gives_the_same_fit(tmp_path):
    log = Session(KIND, segments=6).write(tmp_path / "session.lcm")
    recorded = DataSet.from_log(log)
    assert {i: tuple(u) for i, u in recorded.basis_inputs.items()} == BASIS
    model, _ = train(recorded, ", ".join(EXPRESSIONS))
    for matrix, u in zip(model.matrices, model.basis_inputs, strict=True):
        # Stamps are whole microseconds.
        np.testing.assert_allclose(matrix, propagation(u), atol=1e-6)


def test_any_input_is_predicted_by_the_generators(model):
    rng = np.random.default_rng(0)
    for u in rng.uniform(-1.0, 1.0, (20, 3)) * U_MAX:
        np.testing.assert_allclose(model.matrix(u), propagation(u), atol=1e-11)
    x, u = rng.normal(size=(50, 3)), rng.uniform(-1.0, 1.0, (50, 3)) * U_MAX
    np.testing.assert_allclose(model.step(x, u), OMNIDIRECTIONAL.step(x, u, DT_S), atol=1e-10)


def test_a_model_of_planar_symmetry_is_the_same(dataset, model):
    method = Method(symmetric=True, combination="generator")
    symmetric, _ = train(dataset, ", ".join(EXPRESSIONS), method)
    np.testing.assert_allclose(symmetric.matrices, model.matrices, atol=1e-9)


def test_the_model_file_says_its_robot_by_name(model, tmp_path):
    model.save(tmp_path / "model.npz")
    again = BilinearModel.load(tmp_path / "model.npz")
    assert again.robot is OMNIDIRECTIONAL
    np.testing.assert_array_equal(again.matrices, model.matrices)
    np.testing.assert_array_equal(again.basis_inputs, model.basis_inputs)
    ROBOTS.unregister(KIND)
    with pytest.raises(ModelError, match=r"model\.npz: unknown robot 'omnidirectional', known: "):
        BilinearModel.load(tmp_path / "model.npz")


def test_a_data_set_is_written_and_read_again(dataset, tmp_path):
    dataset.save(tmp_path / "data.npz")
    assert DataSet.load(tmp_path / "data.npz").data_hash == dataset.data_hash
    ROBOTS.unregister(KIND)
    with pytest.raises(DataError, match=r"data\.npz: unknown robot 'omnidirectional'"):
        DataSet.load(tmp_path / "data.npz")


def test_basis_inputs_that_do_not_span_all_inputs_are_refused(model):
    inputs = model.basis_inputs.copy()
    inputs[3] = inputs[1] + inputs[2]
    with pytest.raises(ModelError, match="do not span all inputs"):
        BilinearModel(model.dictionary, model.matrices, inputs, DT_S, {})
    with pytest.raises(ModelError, match=r"matrices of shape \(3, 5, 5\), expected \(4, 5, 5\)"):
        BilinearModel(model.dictionary, model.matrices[:3], inputs[:3], DT_S, {})


def test_the_data_are_described(dataset):
    facts = describe(dataset, ", ".join(EXPRESSIONS))
    assert facts["robot"] == KIND
    assert facts["basis_inputs"]["2"]["input"] == [0.0, 0.2, 0.3]
    assert facts["basis_inputs"]["3"]["excitation"]["rank"] == 5
    assert set(facts["basis_inputs"]["1"]["ranges"]) == {"x1", "x2", "theta"}


def test_errors_along_runs_and_on_held_out_runs_vanish(dataset, model):
    whole = run(KIND, steps=20)
    # A frame with each command, so that no input changes within a sampling time.
    at_commands = whole._replace(utime_us=whole.utime_us[::12], x=whole.x[::12])
    starts = starts_along([at_commands], 10, DT_S, 1.0 / DT_S)
    for predict in (by_model(model), by_model(model, reproject=False)):
        for found in per_step(rolling_deviations(predict, starts, model.robot)):
            assert found.position_max_m < 1e-9
            assert found.angle_max_rad < 1e-9
            assert found.v_max_m_per_s is None
    # The nominal equations know the robot's motion, a wheeled robot's do not.
    nominal = rolling_deviations(by_nominal(OMNIDIRECTIONAL, DT_S), starts, model.robot)
    assert np.nanmax(nominal) < 1e-9
    rest, held = split(dataset, held_out_runs(dataset))
    fitted, _ = train(rest, ", ".join(EXPRESSIONS), Method(combination="generator"))
    assert errors(fitted, held, 10).position_max_m < 1e-9


@pytest.mark.parametrize(
    ("way", "cost_name"),
    [("nominal", "ce"), ("reprojected", "me"), ("reprojected", "ce"), ("lifted", "ds")],
)
def test_our_solver_and_ipopt_agree(affine, way, cost_name):
    settings = lab(cost_name).controller
    of_model = LiftedPrediction if way == "lifted" else KoopmanPrediction
    prediction = NominalPrediction(KIND, DT_S) if way == "nominal" else of_model(affine)
    cost = stage_cost(settings, OMNIDIRECTIONAL, prediction.dictionary)
    solvers = {
        back_end: make_solver(prediction, cost, HORIZON, U_MAX, back_end, 300)
        for back_end in ("ddp", "fatrop", "ipopt")
    }
    assert solvers["ddp"].description == "ddp, compiled"
    rng = np.random.default_rng(3)
    for x0 in rng.uniform(-1.0, 1.0, (4, 3)) * [1.0, 1.0, 0.6]:
        guess = np.tile(0.3 * np.array(U_MAX), (HORIZON, 1))
        plans = {name: solver.solve(x0, guess) for name, solver in solvers.items()}
        for plan in plans.values():
            assert plan.ok
            assert plan.inputs.shape == (HORIZON, 3)
            assert np.all(np.abs(plan.inputs) <= U_MAX)
            assert plan.value == pytest.approx(plans["ipopt"].value, rel=1e-5)
        assert np.any(np.abs(plans["ddp"].inputs) == U_MAX)


@pytest.mark.parametrize("way", ["nominal", "koopman", "ipopt"])
def test_the_closed_loop_reaches_the_goal(affine, way):
    config = lab("me", f"controller.solver={'ipopt' if way == 'ipopt' else 'ddp'}")
    prediction = NominalPrediction(KIND, DT_S) if way == "nominal" else KoopmanPrediction(affine)
    seconds = 1.0 if way == "ipopt" else 6.0
    run_of = closed_loop(config, prediction, X0, seconds)
    assert run_of.unsolved == 0
    assert run_of.inputs.shape == (round(seconds / DT_S), 3)
    assert np.all(np.abs(run_of.inputs) <= U_MAX)
    rows = as_rows(run_of, OMNIDIRECTIONAL)
    assert columns(OMNIDIRECTIONAL)[-4:] == ("u1", "u2", "u3", "value")
    assert {len(row) for row in rows} == {len(columns(OMNIDIRECTIONAL))}
    if way == "ipopt":
        ours = closed_loop(lab(), prediction, X0, seconds)
        np.testing.assert_allclose(run_of.states, ours.states, atol=2e-3)
    else:
        assert np.linalg.norm(run_of.states[-1]) < 0.02


def test_the_offset_free_controller_corrects_its_pose_alone(affine):
    config = lab("me", "controller.offset_free.enabled=true")
    assert closed_loop(config, KoopmanPrediction(affine), X0, 1.0).unsolved == 0


def test_an_unknown_robot_is_one_message_that_lists_the_known_ones():
    ROBOTS.unregister(KIND)
    message = f"unknown robot '{KIND}', known: kinematic, dynamic"
    with pytest.raises(ConfigError, match=message):
        robot_type(KIND)
    with pytest.raises(ConfigError, match=message):
        NominalPrediction(KIND, DT_S)
    with pytest.raises(ConfigError, match=message):
        from_expressions("D5", KIND, EXPRESSIONS)
    assert KIND not in {d.kind for d in dictionaries.DICTIONARIES.values()}
