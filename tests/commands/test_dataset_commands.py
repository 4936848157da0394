"""`klab dataset` and `klab figure`: from a session to what others can use, and back."""

import numpy as np
import pytest
from klab import klab, klab_json, klab_ok

from koopman_lab.koopman.bilinear_model import BilinearModel


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    wanted = ("--robot", "dynamic", "--segments", "5", "--seed", "1")
    klab_ok("calibrate", "--lockstep", *wanted, "--out", folder / "session")
    klab_ok("dataset", "make", folder / "session", "--window", "30", "--out", folder / "data.npz")
    return folder


def test_info_says_what_the_file_holds_and_where_it_is_from(runs):
    facts = klab_json("dataset", "info", runs / "data.npz")
    assert (facts["robot"], facts["window"], facts["dt_s"]) == ("dynamic", 30, 0.05)
    assert facts["source"]["file"] == str(runs / "session" / "session.lcm")
    assert len(facts["source"]["sha256"]) == 64
    assert {basis["excitation"]["rank"] for basis in facts["basis_inputs"].values()} == {8}
    text = klab_ok("dataset", "info", runs / "session", "--dictionary", "D13t")
    assert "13 of 13" in text
    assert "omega (rad/s)" in text


def test_a_set_goes_out_and_comes_back_and_gives_the_same_model(runs):
    klab_ok("dataset", "export", runs / "data.npz", "--format", "dat", "--out", runs / "dat")
    klab_ok("dataset", "import", runs / "dat")
    back = klab_json("dataset", "info", runs / "dat.npz")
    assert back["data_hash"] == klab_json("dataset", "info", runs / "data.npz")["data_hash"]
    models = []
    for source in ("session", "data.npz", "dat", "dat.npz"):
        path = runs / f"model-of-{source}"
        window = ("--window", "30") if source == "session" else ()
        klab_ok("train", runs / source, *window, "--out", path)
        models.append(BilinearModel.load(path))
    for model in models[1:]:
        assert np.array_equal(model.matrices, models[0].matrices)


def test_a_folder_from_elsewhere_trains_with_robot_and_sampling_time(runs, tmp_path):
    klab_ok("dataset", "export", runs / "data.npz", "--out", tmp_path / "own")
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    for file in (tmp_path / "own").glob("[XY]_*.dat"):
        np.savetxt(theirs / file.name, np.loadtxt(file).T)
    told = ("--robot", "dynamic", "--dt", "0.05")
    facts = klab_json("train", theirs, *told, "--out", tmp_path / "m.npz")
    assert facts["dictionary"] == "D8Eul"
    klab_ok("dataset", "import", theirs, *told, "--set", "sampler.basis_inputs=[[0,0],[1,0],[0,1]]")
    bases = klab_json("dataset", "info", tmp_path / "theirs.npz")["basis_inputs"]
    assert [basis["input"] for basis in bases.values()] == [[0, 0], [1, 0], [0, 1]]


def test_the_sweep_as_json_and_with_its_figure(runs, tmp_path):
    facts = klab_json(
        *("dataset", "sweep", runs / "session", "--windows", "1,40", "--out", tmp_path / "sweep")
    )
    assert [row["window"] for row in facts["windows"]] == [1, 40]
    first, second = (abs(row["entries"]["M_0[omega,omega]"] - 1.0) for row in facts["windows"])
    assert second < first
    assert {p.name for p in tmp_path.iterdir()} == {"sweep.pdf", "sweep.png", "sweep.csv"}
    text = klab_ok("dataset", "sweep", runs / "session", "--windows", "10,40")
    assert "M_0[omega,omega]" in text


def test_the_figure_of_samples(runs, tmp_path):
    klab_ok("figure", "samples", runs / "session", "--windows", "10,40", "--out", tmp_path / "s")
    names = {"s.pdf", "s.png", "s-positions.csv", "s-velocities.csv"}
    assert {p.name for p in tmp_path.iterdir()} == names


def test_the_bench_times_the_way_from_log_to_data_set(runs):
    facts = klab_json("bench", "dataset", runs / "session", "--repetitions", "2")
    total = facts["total_s"]
    assert 0.0 < total["median"] <= total["p99"] <= total["max"]
    assert facts["pairs"] > 1000
    assert facts["aim_s"] == 3.0


def test_a_damaged_session_is_salvaged_and_says_so(runs, tmp_path):
    whole = (runs / "session" / "session.lcm").read_bytes()
    (tmp_path / "cut.lcm").write_bytes(whole[:-10])
    done = klab("dataset", "make", tmp_path / "cut.lcm", "--salvage", "--out", tmp_path / "d.npz")
    assert done.returncode == 0
    assert "damaged bytes passed over" in done.stderr
