"""What the library does in Python is what the commands do with the same files."""

import numpy as np
from klab import MODEL, REFERENCE, klab_ok

import koopman_lab as kl

SESSION = REFERENCE / "calibration.lcm"


def test_a_model_trained_in_python_is_the_file_of_the_command(tmp_path):
    klab_ok("train", SESSION, "--ridge", "1e-6", "--out", tmp_path / "by-klab.npz")
    for source in (SESSION, str(SESSION)):
        kl.train(source, ridge=1e-6).save(tmp_path / "in-python.npz")
        assert (tmp_path / "in-python.npz").read_bytes() == (tmp_path / "by-klab.npz").read_bytes()


def test_a_session_is_the_data_set_that_the_command_makes(tmp_path):
    klab_ok("dataset", "make", SESSION, "--window", "20", "--out", tmp_path / "pairs.npz")
    by_klab, in_python = kl.read_data(tmp_path / "pairs.npz"), kl.read_data(SESSION, window=20)
    assert by_klab.data_hash == in_python.data_hash


def test_a_drive_is_drawn_as_by_the_command(tmp_path):
    picture = kl.plot_session(REFERENCE / "park.lcm", str(tmp_path / "park"))
    assert picture._repr_png_().startswith(b"\x89PNG")
    tables = {file.name for file in tmp_path.glob("*.csv")}
    assert tables
    klab_ok("log", "plot", REFERENCE / "park.lcm", "--out", tmp_path / "by-klab")
    assert {f.name.replace("by-klab", "park") for f in tmp_path.glob("by-klab*.csv")} == tables


def test_a_simulation_is_that_of_the_command(tmp_path):
    words = ("simulate", "--model", MODEL, "--start", "0", "0.1", "0", "--duration", "0.5")
    klab_ok(*words, "--set", "controller.horizon=10", "--out", tmp_path / "simulated")
    table = np.genfromtxt(tmp_path / "simulated" / "me-reprojected.csv", delimiter=",", names=True)
    run = kl.Controller(MODEL, horizon=10).simulate([0.0, 0.1, 0.0], 0.5)
    for column, values in zip(("x1_m", "x2_m", "theta_rad"), run.states[:-1].T, strict=True):
        np.testing.assert_array_equal(table[column], values)
