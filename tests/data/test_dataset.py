import dataclasses
import random

import numpy as np
import pytest
from synthetic_session import EPOCH_US, Session

import lcmtypes
from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError, LogError
from koopman_lab.geometry.planar import wrap_angle


@pytest.fixture(scope="module")
def kinematic():
    return Session("kinematic", segments=2)


@pytest.fixture(scope="module")
def dynamic():
    return Session("dynamic", segments=2)


@pytest.fixture
def write(tmp_path):
    return lambda session, messages=None: session.write(tmp_path / "session.lcm", messages)


def check_against_truth(session, dataset, every, tolerances):
    """Compare pairs with the equations, integrated from the start of the run."""
    for index in dataset.basis_inputs:
        assert len(dataset.X[index]) > 100
        for row in range(0, len(dataset.X[index]), every):
            start = int(dataset.start_us[index][row])
            for found, after in ((dataset.X, 0), (dataset.Y, 50_000)):
                error = found[index][row] - session.truth(index, start + after)
                error[2] = wrap_angle(error[2])
                assert np.all(np.abs(error) <= tolerances)


# Stamps are whole microseconds, so Y is up to 1 us of motion away from exactly 50 ms.
POSE_TOLERANCE = [1e-6, 1e-6, 2e-6]


def test_pairs_of_the_kinematic_robot_are_exact(kinematic, write):
    dataset = DataSet.from_log(write(kinematic))
    check_against_truth(kinematic, dataset, 37, POSE_TOLERANCE)
    assert {i: tuple(u) for i, u in dataset.basis_inputs.items()} == {1: (0.2, -0.4), 2: (0.2, 0.6)}
    assert (dataset.dt_s, dataset.robot_kind) == (0.05, "kinematic")


def test_pairs_of_the_second_order_robot_are_exact_with_their_velocities(dynamic, write):
    dataset = DataSet.from_log(write(dynamic))
    # The chord of a central difference is shorter than its arc by (omega h)^2 / 6.
    largest_v, largest_omega = 0.6, 1.5
    v_tolerance = largest_v * (largest_omega / 240.0) ** 2 / 6.0 + 1e-6
    check_against_truth(dynamic, dataset, 97, [*POSE_TOLERANCE, v_tolerance, 1e-6])
    for account in dataset.metadata["basis_inputs"].values():
        assert account["lateral_rms_m_per_s"] < 1e-6


def test_every_frame_of_a_run_that_has_a_successor_gives_a_pair(kinematic, write):
    dataset = DataSet.from_log(write(kinematic))
    for index in dataset.basis_inputs:
        for number, i, start, end, _ in kinematic.runs:
            if i == index:
                inside = [f for f in kinematic.frames if start <= f.utime - EPOCH_US <= end]
                own = dataset.start_us[index][dataset.segments[index] == number]
                assert own.tolist() == [f.utime for f in inside[:-12]]
                account = dataset.metadata["basis_inputs"][str(index)]
                assert account["samples"] == len(dataset.X[index])
                assert (account["segments"], account["runs_with_frames"]) == (2, 2)


def test_smoothing_leaves_out_what_it_would_need_from_outside(dynamic, write):
    path = write(dynamic)
    counts = {window: len(DataSet.from_log(path, window=window).X[1]) for window in (1, 10, 11, 40)}
    assert counts[1] - counts[10] == 2 * 2 * 5
    assert counts[11] == counts[10]
    assert counts[1] - counts[40] == 2 * 2 * 20


def test_the_arrays_are_sorted_by_run_and_angles_of_x_are_wrapped(dynamic, write):
    dataset = DataSet.from_log(write(dynamic))
    for index, X in dataset.X.items():
        assert np.all(np.diff(dataset.start_us[index]) > 0)
        assert np.all(np.abs(X[:, 2]) <= np.pi)
        assert np.abs(dataset.Y[index][:, 2] - X[:, 2]).max() < 0.1


def test_the_time_of_arrival_is_never_data(dynamic, write, tmp_path):
    messages = dynamic.messages()
    first = DataSet.from_log(write(dynamic))
    late = random.Random(1).sample(messages, len(messages))
    path = dynamic.write(tmp_path / "late.lcm", [(c, d, 7) for c, d, _ in late])
    again = DataSet.from_log(path)
    assert again.data_hash == first.data_hash
    assert again.metadata == first.metadata


def test_missing_frames_are_not_bridged(kinematic, write):
    start = kinematic.runs[0][2]
    harmed = [
        (c, d, t)
        for c, d, t in kinematic.messages()
        if c != "R1_MOCAP_POSE" or not start + 500_000 <= t - EPOCH_US < start + 510_000
    ]
    dataset = DataSet.from_log(write(kinematic, harmed))
    times = (dataset.start_us[1][dataset.segments[1] == 0] - EPOCH_US - start) / 1e6
    # Nothing begins in the 50 ms before the gap, since its successor would lie in or behind it.
    assert not np.any((times > 0.451) & (times < 0.509))
    assert times.max() > 0.9
    assert dataset.metadata["basis_inputs"]["1"]["segments"] == 3
    check_against_truth(kinematic, dataset, 37, POSE_TOLERANCE)


def test_the_start_of_each_run_is_discarded(write):
    session = Session("kinematic", segments=1, overrides=["processing.discard_start_s=0.3"])
    dataset = DataSet.from_log(write(session))
    for index, times in dataset.start_us.items():
        begins = [start for _, i, start, _, _ in session.runs if i == index]
        assert 0.3 <= (times[0] - EPOCH_US - begins[0]) / 1e6 < 0.3 + 1 / 240


def test_another_dt_is_matched_by_time_or_interpolated(kinematic, write):
    path = write(kinematic)
    frames, between = (DataSet.from_log(path, dt_s=dt_s) for dt_s in (0.1, 0.0977))
    for dataset, after in ((frames, 100_000), (between, 97_700)):
        start = int(dataset.start_us[1][50])
        error = dataset.Y[1][50] - kinematic.truth(1, start + after)
        error[2] = wrap_angle(error[2])
        # A chord between two frames is off its arc by at most v omega h^2 / 8.
        assert np.abs(error).max() < 0.2 * 0.6 / 240.0**2 / 8 + 2e-6


def test_a_given_configuration_wins_and_must_fit_the_session(kinematic, dynamic, write):
    path = write(kinematic)
    slower = load_config(robot="kinematic", overrides=["processing.dt_s=0.1"])
    assert DataSet.from_log(path, slower).dt_s == 0.1
    with pytest.raises(DataError, match=r"applied \(0.2, -0.4\) as basis input 1"):
        DataSet.from_log(path, dynamic.config)
    other = load_config(robot="kinematic", overrides=["mocap.rate_hz=120"])
    with pytest.raises(DataError, match=r"frames came at 240\.\d Hz, mocap.rate_hz says 120"):
        DataSet.from_log(path, other)


@pytest.mark.parametrize("override", [{"dt_s": 0.0}, {"dt_s": float("nan")}, {"window": 0}])
def test_a_dt_or_window_that_means_nothing_is_refused(kinematic, write, override):
    with pytest.raises(DataError, match="dt must be above 0, the window at least 1"):
        DataSet.from_log(write(kinematic), **override)


def without(session, channel):
    return [row for row in session.messages() if row[0] != channel]


def test_a_log_that_is_no_calibration_is_refused(kinematic, tmp_path):
    path = kinematic.write(tmp_path / "a.lcm", without(kinematic, "R1_SAMPLER_STATE"))
    with pytest.raises(
        DataError, match=r"a\.lcm, R1_SAMPLER_STATE: no complete run .*klab calibrate"
    ):
        DataSet.from_log(path)
    path = kinematic.write(tmp_path / "b.lcm", without(kinematic, "R1_MOCAP_POSE"))
    with pytest.raises(DataError, match="R1_MOCAP_POSE: 0 camera frames"):
        DataSet.from_log(path)
    with pytest.raises(LogError, match="no such log"):
        DataSet.from_log(tmp_path / "c.lcm")


def test_a_basis_input_whose_runs_are_too_short_keeps_its_place_empty(write):
    session = Session("dynamic", segments=1, run_s=0.15)
    dataset = DataSet.from_log(write(session))
    assert {i: X.shape for i, X in dataset.X.items()} == dict.fromkeys(range(3), (0, 5))
    account = dataset.metadata["basis_inputs"]["1"]
    assert (account["segments"], account["segments_too_short"], account["samples"]) == (1, 1, 0)
    assert account["lateral_rms_m_per_s"] is None


def test_a_file_keeps_every_bit_and_the_same_data_give_the_same_file(dynamic, write, tmp_path):
    dataset = DataSet.from_log(write(dynamic))
    dataset.save(tmp_path / "a.npz")
    back = DataSet.load(tmp_path / "a.npz")
    for name in ("X", "Y", "segments", "start_us", "basis_inputs"):
        table, other = getattr(dataset, name), getattr(back, name)
        assert table.keys() == other.keys()
        for index, array in table.items():
            assert array.dtype == other[index].dtype
            assert np.array_equal(array, other[index])
    assert back.data_hash == dataset.data_hash
    assert back.metadata == dataset.metadata
    assert (back.dt_s, back.robot_kind) == (dataset.dt_s, dataset.robot_kind)
    back.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"session.lcm", "a.npz", "b.npz"}


def test_the_hash_sees_every_array_and_fact(kinematic, write):
    dataset = DataSet.from_log(write(kinematic))
    seen = {dataset.data_hash, dataclasses.replace(dataset, dt_s=0.1).data_hash}
    for name in ("X", "Y", "segments", "start_us", "basis_inputs"):
        table = {i: array.copy() for i, array in getattr(dataset, name).items()}
        table[1].flat[0] += 1
        seen.add(dataclasses.replace(dataset, **{name: table}).data_hash)
    assert len(seen) == 7
    assert dataclasses.replace(dataset, metadata={}).data_hash == dataset.data_hash


def test_arrays_that_do_not_fit_together_are_refused(kinematic, write):
    dataset = DataSet.from_log(write(kinematic))
    with pytest.raises(DataError, match=r"Y of basis input 1 has shape"):
        dataclasses.replace(dataset, Y={1: dataset.Y[1][:-1], 2: dataset.Y[2]})
    with pytest.raises(DataError, match=r"Y is of the basis inputs \[1\], expected \[1, 2\]"):
        dataclasses.replace(dataset, Y={1: dataset.Y[1]})
    with pytest.raises(DataError, match="data set of the dynamic robot: X of basis input 1"):
        dataclasses.replace(dataset, robot_kind="dynamic")


def test_files_that_are_no_data_set(kinematic, write, tmp_path):
    path = tmp_path / "data.npz"
    with pytest.raises(DataError, match=r"data\.npz: no such data set"):
        DataSet.load(path)
    DataSet.from_log(write(kinematic)).save(path)
    whole = path.read_bytes()
    for content in (b"", b"text", whole[:100], whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(DataError, match="damaged, or not a data set"):
            DataSet.load(path)
    np.savez(path, other=np.ones(3))
    with pytest.raises(DataError, match="damaged, or not a data set"):
        DataSet.load(path)
    header = np.frombuffer(b'{"format": 99}', np.uint8)
    np.savez(path, header=header)
    with pytest.raises(DataError, match="format 99, this version reads 1"):
        DataSet.load(path)


def test_runs_that_were_given_up_do_not_count(kinematic, write):
    start = kinematic.runs[0][2]
    messages = []
    for channel, data, utime in kinematic.messages():
        if channel == "R1_SAMPLER_STATE" and 500_000 <= utime - EPOCH_US - start < 1_000_000:
            state = lcmtypes.sampler_state_t.decode(data)
            state.phase = state.BRAKE
            messages.append((channel, state.encode(), utime))
        else:
            messages.append((channel, data, utime))
    dataset = DataSet.from_log(write(kinematic, messages))
    others = {number for number, i, *_ in kinematic.runs if i == 1 and number != 0}
    assert set(dataset.segments[1]) == others
    assert (dataset.metadata["runs"], dataset.metadata["runs_given_up"]) == (3, 1)
