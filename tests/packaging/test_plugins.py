"""A package of a stranger adds a row to each table, and `klab` uses each by its name."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from klab import MODEL, REFERENCE, klab, start_klab
from plugin_package import install
from real_bus import Ear, recorded

import lcmtypes
from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import ENCODER, MOCAP_POSE
from offboard.terminal.exit_codes import ExitCode

SUPPORT = Path(__file__).parents[1] / "support"
MODULES = {name: (SUPPORT / f"{name}.py").read_text() for name in ("stranger", "stranger_models")}
BEACON_HEARTBEAT = Channel("BEACON_HEARTBEAT", lcmtypes.node_status_t, "heartbeat", "beacon")
"""The table of this process knows no stranger."""
ROWS = {
    "koopman_lab.nodes": {"beacon": "stranger:BEACON"},
    "koopman_lab.drivers": {"acme": "stranger:ACME_MOTORS"},
    "koopman_lab.cameras": {"acme": "stranger:ACME_CAMERAS"},
    "koopman_lab.costs": {"fourth": "stranger_models:FOURTH"},
    "koopman_lab.predictors": {"gains": "stranger_models:GAINS"},
    "koopman_lab.log_formats": {"counts": "stranger:COUNTS"},
}


def path_of(folder, monkeypatch):
    """Let processes that are started from now on find what is installed in a folder."""
    monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """Install a package with a row in every table."""
    path_of(install(tmp_path / "site", ROWS, MODULES), monkeypatch)
    # What broke in other tests is remembered elsewhere.
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))


def run(*arguments):
    """Run `klab` in a process of its own, which finds the package."""
    return klab(*arguments, env=dict(os.environ))


def entries(robot="R1"):
    """Return what `klab status` says of each process of a robot."""
    return {entry["name"]: entry for entry in json.loads(run("status", "--json").stdout)[robot]}


def end(*processes):
    """End processes as `klab down` does not: those that were started by hand."""
    said = []
    for process in processes:
        process.terminate()
        said.append(process.communicate(timeout=60)[0])
    return said


@pytest.mark.usefixtures("stranger")
def test_a_node_of_a_stranger_is_one_of_the_lab(bus_url, tmp_path):
    ear, beats = Ear(bus_url), []
    ear.listener.subscribe(BEACON_HEARTBEAT, beats.append)
    lab = start_klab("up", "--with", "beacon", "--out", tmp_path / "up")
    try:
        ear.wait_for("plant", "onboard", "logger")
        ear.wait(lambda: beats)
        beacon = entries()["beacon"]
        assert (beacon["state"], beacon["needs"]) == ("alive", ["onboard"])
        assert beacon["pid"] == beats[-1].pid
        assert "klab down" in beacon["stopped_by"]
        assert beacon["log_file"].endswith("beacon.log")
        echo = run("topics", "--echo", "R1_BEACON_STATE", "--once")
        assert json.loads(echo.stdout)["events"] == 1
        assert "R1 is down" in run("down").stderr
        lab.communicate(timeout=60)
        assert lab.returncode == 130
    finally:
        lab.kill()
        lab.communicate()
    assert (tmp_path / "up" / "processes" / "beacon.log").read_text() == "beacon of R1 ends\n"
    channels = recorded(tmp_path / "up" / "session.lcm")
    assert len(channels["R1_BEACON_HEARTBEAT"]) > 2
    assert len(channels["R1_BEACON_STATE"]) > 5


@pytest.mark.usefixtures("stranger")
def test_a_node_of_a_stranger_runs_by_hand_for_any_robot(bus_url):
    ear, beats = Ear(bus_url, "R7"), []
    ear.listener.subscribe(BEACON_HEARTBEAT, beats.append)
    started = start_klab("run", "beacon", "--robot-name", "R7")
    ear.wait(lambda: beats)
    assert entries("R7")["beacon"]["pid"] == started.pid == beats[0].pid
    assert end(started) == ["beacon of R7 ends\n"]
    assert started.returncode == 0


@pytest.mark.usefixtures("stranger")
def test_motors_and_cameras_of_a_stranger_take_the_place_of_the_plant(bus_url):
    ear, counts, poses = Ear(bus_url), [], []
    ear.listener.subscribe(ENCODER, counts.append)
    ear.listener.subscribe(MOCAP_POSE, poses.append)
    started = [
        start_klab("run", "onboard"),
        start_klab("run", "driver", "--driver", "acme"),
        start_klab("run", "mocap", "--driver", "acme"),
    ]
    try:
        ear.wait_for("onboard", "driver", "mocap")
        ear.wait(lambda: counts and poses)
        ear.wait(lambda: ear.status is not None and ear.status.battery_v == 12.0)
        assert (poses[-1].x1_m, poses[-1].x2_m, poses[-1].theta_rad) == (1.0, 2.0, 0.5)
        assert {name: e["state"] for name, e in entries().items()} == {
            "onboard": "alive",
            "driver": "alive",
            "mocap": "alive",
        }
        # No plant speaks beside them.
        refused = run("up")
        assert refused.returncode == ExitCode.LAB_FAILURE
        assert "driver, mocap, onboard of R1 already on" in refused.stderr
    finally:
        end(*started)


@pytest.mark.usefixtures("stranger")
def test_a_stranger_learns_a_model_and_parks_with_it_and_a_cost_of_its_own(tmp_path, monkeypatch):
    model, folder = tmp_path / "gains.npz", tmp_path / "park"
    learned = run("train", REFERENCE / "calibration.lcm", "--predictor", "gains", "--out", model)
    assert learned.returncode == 0, learned.stderr
    assert "gains: " in learned.stdout
    facts = json.loads(run("model", "info", model, "--json").stdout)
    assert (facts["predictor"], facts["package"]) == ("gains", "klab-stranger")
    # The lab's robot drives about as far as it is told.
    np.testing.assert_allclose(facts["gains"], 1.0, atol=0.1)
    parked = run(
        *("park", "--model", model, "--cost", "fourth", "--start", "-0.3", "0.1", "0"),
        *("--lockstep", "--out", folder),
    )
    assert parked.returncode == 0, parked.stderr
    assert json.loads((folder / "summary.json").read_text())["parked"]
    assert "cost: fourth" in (folder / "config.yaml").read_text()
    # Where the package is missing, all say what to install.
    monkeypatch.delenv("PYTHONPATH")
    for command in (("model", "info", model), ("park", "--model", model, "--lockstep")):
        done = run(*command)
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert f"{model}: a model of the predictor 'gains', which is not installed" in line
        assert "install the package klab-stranger" in line
    done = run("park", "--model", MODEL, "--set", "controller.cost=fourth", "--lockstep")
    assert done.returncode == 2
    assert "controller.cost: input should be 'me', 'ce' or 'ds', found 'fourth'" in done.stderr


@pytest.mark.usefixtures("stranger")
def test_a_log_is_written_in_a_format_of_a_stranger(tmp_path):
    out = tmp_path / "park.counts"
    done = run("log", "export", REFERENCE / "park.lcm", "--format", "counts", "--out", out)
    assert done.returncode == 0, done.stderr
    counts = json.loads(out.read_text())
    expected = recorded(REFERENCE / "park.lcm")
    assert counts == {name: len(messages) for name, messages in expected.items()}


@pytest.mark.usefixtures("stranger")
@pytest.mark.parametrize(
    ("command", "shown"),
    [
        (("run", "--help"), "Run the node 'beacon' of the package klab-stranger"),
        (("run", "beacon", "--help"), "--robot-name"),
        (("up", "--help"), "--with <beacon>"),
        (("run", "driver", "--help"), "--driver <plant|acme>"),
        (("run", "mocap", "--help"), "--driver <plant|acme>"),
        (("train", "--help"), "--predictor <edmd|gains>"),
        (("park", "--help"), "--cost <me|ce|ds|fourth>"),
        (("study", "weights", "--help"), "--cost <me|ce|ds|fourth>"),
        (("compare", "--help"), "--controller <me|ce|ds|fourth|nominal>"),
        (("log", "export", "--help"), "--format <csv|mcap|ros2|mat|parquet|counts>"),
    ],
)
def test_what_is_added_is_shown(command, shown):
    done = run(*command)
    assert done.returncode == 0, done.stderr
    assert shown in " ".join(done.stdout.split())


BROKEN = """
from koopman_lab.bus.hardware import Hardware
from koopman_lab.bus.processes import Process

LATER = Process("later", "no_such_module:Node")
LONELY = Process("lonely", "stranger:Beacon", needs=("sampler",))
PACER = Process("pacer", "stranger:Beacon")
OTHER = Process("other", "stranger:Beacon")
OLD = Process("old", "stranger:Beacon")
MOTORS = Hardware("motors", "no_such_module:Driver", "driver")
"""
BROKEN_ROWS = {
    "koopman_lab.nodes": {
        "absent": "no_such_module:ROW",
        "later": "broken:LATER",
        "lonely": "broken:LONELY",
        "pacer": "broken:PACER",
        "twice": "broken:OTHER",
        "other": "broken:OTHER",
    },
    "koopman_lab.drivers": {"motors": "broken:MOTORS"},
    "koopman_lab.cameras": {"eyes": "no_such_module:ROW"},
    "koopman_lab.robots": {"omni": "no_such_module:ROW", "kinematic": "no_such_module:ROW"},
    "koopman_lab.costs": {"huber": "no_such_module:ROW", "ds": "stranger_models:FOURTH"},
    "koopman_lab.predictors": {"resnet": "no_such_module:ROW"},
    "koopman_lab.log_formats": {"tape": "no_such_module:ROW"},
}
OF = "of the package klab-stranger"
PARK = ("park", "--model", MODEL, "--lockstep", "--cost")
NO_MODULE = "cannot be loaded: ModuleNotFoundError: No module named 'no_such_module'"


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """Install packages with everything that does not fit; return where."""
    folder = tmp_path_factory.mktemp("broken")
    install(folder, BROKEN_ROWS, {"broken": BROKEN, **MODULES})
    old = {"koopman_lab.nodes": {"old": "broken:OLD", "twice": "broken:OLD"}}
    return install(folder, old, {}, name="klab-old", requires="koopman-lab>=99")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("run", "absent"), (f"node 'absent' {OF} (no_such_module:ROW)", NO_MODULE)),
        (("up", "--with", "absent"), (f"node 'absent' {OF} (no_such_module:ROW)", NO_MODULE)),
        (("run", "later"), (f"node 'later' {OF} (no_such_module:Node)", NO_MODULE)),
        (("up", "--with", "lonely"), ("--with lonely: needs sampler",)),
        (("run", "pacer"), ("node 'pacer' is in koopman-lab and in klab-stranger",)),
        (("run", "twice"), ("node 'twice' is in klab-", " and in klab-")),
        (("run", "other"), (f"node 'other' {OF}: its node calls itself 'beacon'",)),
        (("run", "old"), ("node 'old' of the package klab-old is for koopman-lab>=99",)),
        (("run", "driver", "--driver", "motors"), (f"driver 'motors' {OF}", NO_MODULE)),
        (("run", "mocap", "--driver", "eyes"), (f"camera bridge 'eyes' {OF}", NO_MODULE)),
        (("run", "onboard", "--robot", "omni"), (f"robot 'omni' {OF}", NO_MODULE)),
        (
            ("run", "onboard", "--robot", "kinematic"),
            ("robot 'kinematic' is in koopman-lab and in klab-stranger",),
        ),
        ((*PARK, "huber"), (f"cost 'huber' {OF}", NO_MODULE)),
        ((*PARK, "ds"), ("cost 'ds' is in koopman-lab and in klab-stranger",)),
        (("train", "absent", "--predictor", "resnet"), (f"predictor 'resnet' {OF}", NO_MODULE)),
        (("log", "export", "absent", "--format", "tape"), (f"log format 'tape' {OF}", NO_MODULE)),
    ],
    ids=lambda value: " ".join(map(str, value[:2])) if isinstance(value, tuple) else None,
)
def test_what_does_not_fit_is_one_message(command, said, broken, monkeypatch, tmp_path):
    path_of(broken, monkeypatch)
    done = klab(*command, env=dict(os.environ), cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("klab: ")
    for words in said:
        assert words in line
    assert not list(tmp_path.iterdir())


def test_whoever_asks_for_nothing_that_is_broken_does_not_notice(broken, monkeypatch, bus_url):
    """Nor does a robot whose name a package has taken: least of all an emergency stop."""
    path_of(broken, monkeypatch)
    listing = run("run", "--help")
    assert listing.returncode == 0
    assert "absent" in listing.stdout
    ear = Ear(bus_url)
    started = start_klab("run", "plant"), start_klab("run", "onboard")
    try:
        ear.wait_for("plant", "onboard")
        heard = entries()
        assert {name: entry["state"] for name, entry in heard.items()} == {
            "plant": "alive",
            "onboard": "alive",
        }
        assert run("estop").returncode == 0
    finally:
        end(*started)


def test_the_doctor_names_everything_that_is_broken(broken, monkeypatch):
    path_of(broken, monkeypatch)
    done = run("doctor")
    assert done.returncode == ExitCode.NO
    lines = [line for line in done.stdout.splitlines() if line.startswith("plug-in: BROKEN")]
    nodes = ("absent", "later", "pacer", "twice", "old")
    for name in (*nodes, "motors", "eyes", "omni", "kinematic", "huber", "ds", "resnet", "tape"):
        assert any(f"'{name}' " in line for line in lines), name
    lines = done.stdout.splitlines()
    assert "plug-in: ok (node 'lonely' of the package klab-stranger)" in lines


def test_the_command_line_starts_without_a_look_at_other_packages():
    code = (
        "from koopman_lab import registry\n"
        "registry._entry_points = None\n"
        "import offboard.cli.main\n"
        "from koopman_lab.config.load import load_config\n"
        "from koopman_lab.bus.channels import HEARTBEATS\n"
        "from koopman_lab.bus.processes import priority_of\n"
        "for robot in ('kinematic', 'dynamic'): load_config(robot=robot)\n"
        "HEARTBEATS['onboard'], priority_of('onboard')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
