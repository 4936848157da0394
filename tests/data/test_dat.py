"""Folders of X_i.dat and Y_i.dat, as published and as written here."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from ideal_data import ideal_dataset

from koopman_lab.data.dat import is_folder, read_folder, write_folder
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError

TABLES = ("X", "Y", "segments", "start_us", "basis_inputs")


def same(one, other):
    for name in TABLES:
        table, others = getattr(one, name), getattr(other, name)
        assert table.keys() == others.keys()
        for index, array in table.items():
            assert np.array_equal(array, others[index])
            assert array.dtype == others[index].dtype


def publish(folder, dataset, *, columns=False, delimiter=" ", indices=None):
    """Write a folder as somebody else would: nothing but the matrices."""
    folder.mkdir()
    for index in dataset.X if indices is None else indices:
        for letter, table in (("X", dataset.X), ("Y", dataset.Y)):
            pairs = table[index].T if columns else table[index]
            np.savetxt(folder / f"{letter}_{index}.dat", pairs, "%.17g", delimiter)
    return folder


@pytest.fixture
def dynamic():
    return ideal_dataset("dynamic", segments=3, steps=10)


@pytest.fixture
def kinematic():
    return ideal_dataset("kinematic", segments=3, steps=10)


@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_what_is_written_is_read_to_the_last_bit(kind, tmp_path):
    dataset = dataclasses.replace(ideal_dataset(kind), metadata={"made": "here"})
    write_folder(dataset, tmp_path / "set")
    back = read_folder(tmp_path / "set")
    same(dataset, back)
    assert back.data_hash == dataset.data_hash
    assert (back.robot_kind, back.dt_s, back.metadata) == (kind, 0.05, {"made": "here"})


@given(
    st.integers(0, 5).flatmap(lambda d: arrays(float, (2, d, 3), elements=st.floats(-3.0, 3.0))),
    st.integers(-(2**62), 2**62),
)
def test_any_numbers_survive(tmp_path_factory, xy, start):
    d = xy.shape[1]
    dataset = DataSet(
        X={1: xy[0], 2: xy[0] * 0.5},
        Y={1: xy[0] + 0.01 * xy[1], 2: xy[0] * 0.5},
        segments={i: np.arange(d) for i in (1, 2)},
        start_us={i: np.full(d, start) for i in (1, 2)},
        basis_inputs={1: np.array([0.2, -0.4]), 2: np.array([0.2, 0.6])},
        dt_s=0.1,
        robot_kind="kinematic",
        metadata={},
    )
    folder = tmp_path_factory.mktemp("any")
    write_folder(dataset, folder)
    same(dataset, read_folder(folder))


@pytest.mark.parametrize("columns", [False, True])
@pytest.mark.parametrize("delimiter", [" ", ",", ";", "\t"])
def test_rows_and_columns_are_told_apart(dynamic, tmp_path, columns, delimiter):
    folder = publish(tmp_path / "set", dynamic, columns=columns, delimiter=delimiter)
    back = read_folder(folder, "dynamic", 0.05)
    for index in dynamic.X:
        assert np.array_equal(back.X[index], dynamic.X[index])
        assert np.array_equal(back.Y[index], dynamic.Y[index])
    assert not back.metadata["segments_known"]
    assert {i: tuple(u) for i, u in back.basis_inputs.items()} == {
        0: (0.0, 0.0),
        1: (0.2, 0.0),
        2: (0.0, 0.5),
    }


def test_zero_input_may_be_there_for_the_kinematic_robot(kinematic, tmp_path):
    without = read_folder(publish(tmp_path / "a", kinematic), "kinematic", 0.05)
    assert sorted(without.X) == [1, 2]
    folder = publish(tmp_path / "b", kinematic)
    for letter in "XY":
        np.savetxt(folder / f"{letter}_0.dat", kinematic.X[1])
    assert read_folder(folder, "kinematic", 0.05).basis_inputs[0].tolist() == [0.0, 0.0]


def test_other_basis_inputs_can_be_said(kinematic, tmp_path):
    folder = publish(tmp_path / "set", kinematic)
    back = read_folder(folder, "kinematic", 0.05, {1: (0.1, 0.0), 2: (0.0, 1.0)})
    assert back.basis_inputs[2].tolist() == [0.0, 1.0]


def test_angles_are_continued(kinematic, tmp_path):
    turn = np.array([0.0, 0.0, 2.0 * np.pi])
    wrapped = dataclasses.replace(
        kinematic,
        X={i: x + 2 * turn for i, x in kinematic.X.items()},
        Y={i: y - turn for i, y in kinematic.Y.items()},
    )
    back = read_folder(publish(tmp_path / "set", wrapped), "kinematic", 0.05)
    for index in kinematic.X:
        assert back.X[index] == pytest.approx(kinematic.X[index], abs=1e-12)
        assert back.Y[index] == pytest.approx(kinematic.Y[index], abs=1e-12)
    assert back.metadata["angles_shifted"] == sum(map(len, kinematic.X.values()))


def refused(folder, words, kind="dynamic", dt_s=0.05):
    with pytest.raises(DataError, match=words) as raised:
        read_folder(folder, kind, dt_s)
    assert str(folder) in str(raised.value)


def test_shapes_that_do_not_fit_are_told(dynamic, tmp_path):
    folder = publish(tmp_path / "set", dynamic)
    refused(folder, r"neither .* 3 numbers \(x1, x2, theta .* X_1\.dat 30 by 5", "kinematic")
    np.savetxt(folder / "Y_1.dat", dynamic.Y[1][:-2], "%.17g")
    refused(folder, r"X_1\.dat holds 30 states, Y_1\.dat 28")
    np.savetxt(folder / "Y_1.dat", np.ones((30, 6)))
    refused(folder, r"Y_1\.dat 30 by 6, .*; see --robot")


def test_square_files_cannot_be_told_apart(dynamic, tmp_path):
    square = {i: x[:5] for i, x in dynamic.X.items()}
    folder = tmp_path / "set"
    folder.mkdir()
    for index, x in square.items():
        for letter in "XY":
            np.savetxt(folder / f"{letter}_{index}.dat", x)
    refused(folder, "both rows and columns hold 5 numbers")


def test_missing_and_unknown_files_are_named(dynamic, tmp_path):
    folder = publish(tmp_path / "set", dynamic)
    (folder / "Y_2.dat").unlink()
    refused(folder, r"lacks Y_2\.dat; a data set of the dynamic robot is X_0\.dat")
    folder = publish(tmp_path / "other", dynamic)
    for letter in "XY":
        np.savetxt(folder / f"{letter}_3.dat", dynamic.X[1])
    refused(folder, r"has no basis input for X_3\.dat, Y_3\.dat")
    assert not is_folder(tmp_path)
    refused(tmp_path, r"holds no X_i\.dat")
    refused(tmp_path / "nowhere", r"holds no X_i\.dat")


def test_what_the_folder_does_not_say_must_be_said(dynamic, tmp_path):
    folder = publish(tmp_path / "set", dynamic)
    refused(folder, "--robot kinematic or --robot dynamic, and --dt", None)
    refused(folder, "does not say", "dynamic", None)
    refused(folder, "sampling time nan s", "dynamic", float("nan"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"1 2 3 4 5\n1 2 x 4 5\n", r"X_1\.dat: line 2: 'x' is no number"),
        (b"1 2 3 4 5\n1 2 3 4\n", r"X_1\.dat: line 2 holds 4 numbers, line 1 5"),
        (b"\xff\xfe\x00", r"X_1\.dat: is not UTF-16-LE"),
        (b"1 2 3 4 5\n1 2 nan 4 5\n", r"nan in line 2, column 3"),
        (b"", r"X_1\.dat holds 0 states, Y_1\.dat 30"),
    ],
)
def test_damaged_files_are_named(dynamic, tmp_path, content, words):
    folder = publish(tmp_path / "set", dynamic)
    (folder / "X_1.dat").write_bytes(content)
    refused(folder, words)


def test_damage_to_what_was_written_here_is_named(dynamic, tmp_path):
    folder = tmp_path / "set"
    write_folder(dynamic, folder)
    with pytest.raises(DataError, match="set: is not empty"):
        write_folder(dynamic, folder)
    whole = (folder / "pairs_1.dat").read_bytes()
    (folder / "pairs_1.dat").write_bytes(whole[: len(whole) // 2])
    refused(folder, r"pairs_1\.dat: ")
    (folder / "pairs_1.dat").write_bytes(whole)
    (folder / "dataset.json").write_text('{"robot_kind": "boat"}')
    refused(folder, r"dataset\.json: damaged, or not the header of a data set: dt_s: .* remove it")


def test_a_folder_that_cannot_be_finished_does_not_appear(dynamic, tmp_path):
    unfit = dataclasses.replace(dynamic, metadata={"no JSON": object()})
    with pytest.raises(TypeError):
        write_folder(unfit, tmp_path / "set")
    assert list(tmp_path.iterdir()) == []
