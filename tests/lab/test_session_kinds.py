"""What the kinds of sessions have in common: each is one description, run by one function."""

import json
from pathlib import Path

import pytest
from klab import MODEL, klab
from typer.testing import CliRunner

import offboard.lab.session_runner
from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError, LabStateError, ModelError, UsageError
from koopman_lab.geometry.planar import Pose
from koopman_lab.mpc import receding_horizon
from koopman_lab.predictors import table
from koopman_lab.predictors.bilinear_edmd import KoopmanPrediction
from offboard.cli.main import app
from offboard.lab.calibration import Calibration
from offboard.lab.parking_run import Parking
from offboard.lab.reference_runs import ReferenceRuns
from offboard.reference.shapes import Shape
from offboard.sampler.redraws import Redraw

GOAL = Pose(0.5, -0.2, 0.7)
NEAR = ("--start", "-0.1", "0", "0", "--set", "controller.parked_hold_s=0.1")
KINDS = [Calibration(), ReferenceRuns(Shape.SQUARE), Parking(MODEL, GOAL)]
FIRST_PHASES = {
    "sampler": {"WAIT"},
    "reference": {"WAIT", "PLACE"},
    "controller": {"WAIT"},
}
"""Of the states in which a node waits for somebody else."""
OTHER_NUMBERS = {*Shape.__members__, *Redraw.__members__, "REASONS"}
"""Constants of those messages that are no phases."""


@pytest.fixture
def counted(monkeypatch):
    """Count what is expensive: model files read, and solvers made."""
    counts = {"models": 0, "solvers": 0}
    read, make = table.read_model_file, receding_horizon.make_solver

    def counted_read(path):
        counts["models"] += 1
        return read(path)

    def counted_make(*arguments, **options):
        counts["solvers"] += 1
        return make(*arguments, **options)

    monkeypatch.setattr(table, "read_model_file", counted_read)
    monkeypatch.setattr(receding_horizon, "make_solver", counted_make)
    return counts


def test_a_park_reads_its_model_once_and_makes_one_solver(counted, tmp_path):
    done = klab("park", "--model", MODEL, *NEAR, "--lockstep", "--out", tmp_path / "park")
    assert done.returncode == 0, done.stderr
    assert counted == {"models": 1, "solvers": 1}


def test_a_comparison_reads_its_model_once_and_makes_a_solver_for_each_controller(
    counted, tmp_path
):
    short = ("--set", "controller.time_limit_s=1", "--set", "controller.horizon=5")
    contestants = ("--controller", "me", "--controller", "nominal")
    done = klab(
        *("compare", "--model", MODEL, *contestants, *short, "--lockstep"),
        *("--out", tmp_path / "compare"),
    )
    assert done.returncode == 0, done.stderr
    assert counted == {"models": 1, "solvers": 2}


@pytest.mark.parametrize(
    ("overrides", "goal", "error", "said"),
    [
        (["controller.dt_s=0.1"], GOAL, ModelError, "sampling time"),
        (["controller.cost=ds"], GOAL, ConfigError, "controller.weights"),
        ([], Pose(99.0, 0.0, 0.0), UsageError, "floor"),
        ([], GOAL, None, ""),
    ],
)
def test_what_is_impossible_is_refused_without_a_solver(counted, overrides, goal, error, said):
    weights = "controller.weights.ds={q: [1, 1], r: [1, 1]}"
    config = load_config(robot="kinematic", overrides=[*overrides, weights])
    session = Parking(Path("unread.npz"), goal, prediction=KoopmanPrediction(loaded()))
    if error is None:
        session.require_possible(config)
    else:
        with pytest.raises(error, match=said):
            session.require_possible(config)
    assert counted["solvers"] == 0


def loaded():
    return table.load_model(MODEL)


def test_a_model_of_the_other_robot_is_refused_without_a_solver(counted):
    session = Parking(MODEL, GOAL)
    with pytest.raises(ModelError, match="kinematic"):
        session.require_possible(load_config(robot="dynamic"))
    assert counted == {"models": 1, "solvers": 0}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.node_name)
def test_the_process_makes_the_node_that_the_session_would(kind, monkeypatch, tmp_path):
    """The arguments of its process say all that the session knows."""
    runs = []
    monkeypatch.setattr(
        offboard.lab.session_runner, "run_process", lambda *arguments: runs.append(arguments)
    )
    arguments = [*map(str, kind.arguments()), "--result", str(tmp_path / "result.json")]
    done = CliRunner().invoke(app, ["run", kind.node_name, *arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    ((again, _, result, _),) = runs
    assert type(again) is type(kind)
    public = {name: value for name, value in vars(kind).items() if not name.startswith("_")}
    for name, value in public.items():
        # Angles go through degrees, which costs the last bit.
        same = pytest.approx(value, abs=1e-15) if isinstance(value, Pose) else value
        assert vars(again)[name] == same, name
    assert result == tmp_path / "result.json"


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.node_name)
def test_a_session_has_begun_once_its_node_waits_for_nobody(kind):
    message = kind.state_channel.type()
    field = "state" if hasattr(message, "state") else "phase"
    states = {
        name: number
        for name, number in vars(type(message)).items()
        if name.isupper() and isinstance(number, int) and name not in OTHER_NUMBERS
    }
    assert states.keys() > FIRST_PHASES[kind.node_name]
    waiting = set()
    for name, number in states.items():
        setattr(message, field, number)
        if not kind.has_begun(message):
            waiting.add(name)
    assert waiting == FIRST_PHASES[kind.node_name]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.node_name)
def test_what_a_node_brings_in_its_process_is_what_the_session_reads(kind, tmp_path):
    config = load_config(robot="kinematic")
    node = kind.make_node(config)
    outcome = kind.outcome(node, 3)
    file = tmp_path / "outcome.json"
    file.write_text(json.dumps(outcome.model_dump()))
    assert offboard.lab.session_runner.read_outcome(file, kind.outcome_type) == outcome
    assert outcome.missed_deadlines == 3


@pytest.mark.parametrize("text", [None, "", "{}", '{"parked": true}', "[1, 2]"])
def test_an_outcome_that_cannot_be_read_is_one_clear_message(text, tmp_path):
    file = tmp_path / "controller.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(LabStateError, match=r"controller\.json: .*cannot be read"):
        offboard.lab.session_runner.read_outcome(file, Parking.outcome_type)
