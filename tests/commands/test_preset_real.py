"""What a person asks of a robot with --preset real is driven; a plant is refused in one line."""

import json

import pytest
from klab import klab, klab_ok

from koopman_lab.config.load import dump_config, load_config

ROBOTS = {"kinematic": "5", "dynamic": "10"}
"""Segments per basis input, which show all observables."""


@pytest.mark.parametrize("robot", ROBOTS)
def test_calibration_and_park_keep_inside_the_limits(robot, tmp_path):
    """On the robot of preset lab; plans are by the equations, as the model is of few segments."""
    real, lab = (load_config(robot=robot, preset=preset) for preset in ("real", "lab"))
    config = tmp_path / "config.yaml"
    config.write_text(dump_config(real.model_copy(update={"simulation": lab.simulation})))
    session, model, park = (tmp_path / name for name in ("session", "model.npz", "park"))
    common = ("--lockstep", "--config", config)
    klab_ok("calibrate", *common, "--segments", ROBOTS[robot], "--out", session)
    klab_ok("train", session, "--out", model)
    nominal = ("--set", "controller.predict=nominal")
    klab_ok("park", *common, *nominal, "--model", model, "--out", park)
    assert json.loads((session / "summary.json").read_text())["complete"]
    assert json.loads((park / "summary.json").read_text())["parked"]


REFUSED = (
    ("calibrate", "--lockstep"),
    ("reference", "--shape", "infinity", "--lockstep"),
    ("demo", "--lockstep"),
    ("up",),
    ("run", "plant"),
    ("bench", "lockstep"),
    ("bench", "motor"),
    ("bench", "faults"),
)


@pytest.mark.parametrize("arguments", REFUSED, ids=" ".join)
def test_where_nothing_is_simulated_no_plant_is_started(arguments, tmp_path):
    done = klab(*arguments, "--preset", "real", cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("klab: ") == 1
    assert "simulation: null" in done.stderr
    assert "--preset lab" in done.stderr
    assert not list(tmp_path.iterdir())


def test_in_real_time_a_session_needs_a_robot_that_is_there(tmp_path, bus_url):
    done = klab("calibrate", "--preset", "real", "--url", bus_url, "--out", tmp_path / "session")
    assert done.returncode == 2, done.stderr
    assert "start `klab run onboard`" in done.stderr
    assert not (tmp_path / "session" / "session.lcm").exists()
