"""A file of arrays says in one line what of it cannot be used, and takes no memory to say so."""

import io
import json
import os
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.array_file import ArrayRow, checked_arrays, read_array_file
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError, LabError, ModelError
from koopman_lab.files import open_file
from koopman_lab.json_file import Refusal
from koopman_lab.koopman.model_file import read_model_file
from koopman_lab.predictors.table import load_model

MODEL = Path(__file__).parents[1] / "data" / "reference" / "model.npz"


def entries(path):
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    return json.loads(bytes(arrays.pop("header"))), arrays


def write(path, header, arrays):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    with path.open("wb") as file:
        np.savez(file, header=np.frombuffer(text, np.uint8), **arrays)


def npy(array):
    text = io.BytesIO()
    np.lib.format.write_array(text, array, allow_pickle=True)
    return text.getvalue()


def zipped(path, contents, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)


def with_value(array, place, value):
    changed = array.copy()
    changed[place] = value
    return changed


def header_with(key, value):
    """Return what sets a key of the header, dotted, or takes it away where the value is ...."""

    def change(header, arrays):
        del arrays
        *above, last = key.split(".")
        inside = header
        for name in above:
            inside = inside.setdefault(name, {})
        if value is ...:
            del inside[last]
        else:
            inside[last] = value

    return change


def array_with(name, replacement):
    def change(header, arrays):
        del header
        arrays[name] = replacement(arrays[name])

    return change


def without(name):
    return lambda _, arrays: arrays.pop(name)


REASONS = [{"level": "good", "text": 3}]
MODEL_DAMAGES = {
    "not a number": (array_with("matrices", lambda m: with_value(m, (0, 1, 2), np.nan)), "matrices",
                     "finite numbers", "nan at [0, 1, 2]"),
    "infinite": (array_with("basis_inputs", lambda u: with_value(u, (1, 0), -np.inf)),
                 "basis_inputs", "-inf at [1, 0]"),
    "too large": (array_with("matrices", lambda m: with_value(m, (0, 0, 0), 1e200)), "matrices",
                  "1e+09", "1e+200 at [0, 0, 0]"),
    "another shape": (array_with("matrices", lambda m: m[:, :4]), "matrices",
                      "shape (3, 5, 5)", "shape (3, 4, 5)"),
    "a scalar": (array_with("matrices", lambda m: m[0, 0, 0]), "matrices", "shape ()"),
    "flat": (array_with("matrices", np.ravel), "matrices", "shape (75,)"),
    "empty": (array_with("matrices", lambda m: m[:0]), "matrices", "shape (0, 5, 5)"),
    "complex": (array_with("matrices", lambda m: m + 1j), "matrices", "complex128"),
    "text": (array_with("matrices", lambda m: m.astype("U9")), "matrices", "<U9"),
    "truth values": (array_with("basis_inputs", lambda u: u > 0), "basis_inputs", "bool"),
    "no matrices": (without("matrices"), "matrices", "no such entry"),
    "no basis inputs": (without("basis_inputs"), "basis_inputs", "no such entry"),
    "dt not a number": (header_with("dt_s", float("nan")), "dt_s", "nan"),
    "dt infinite": (header_with("dt_s", float("inf")), "dt_s", "inf"),
    "dt negative": (header_with("dt_s", -0.05), "dt_s", "-0.05"),
    "dt zero": (header_with("dt_s", 0), "dt_s", "0"),
    "dt of a year": (header_with("dt_s", 3e7), "dt_s", "30000000"),
    "dt text": (header_with("dt_s", "0.05"), "dt_s", "'0.05'"),
    "dt null": (header_with("dt_s", None), "dt_s", "None"),
    "no dt": (header_with("dt_s", ...), "dt_s", "nothing"),
    "format text": (header_with("format", "2"), "format", "'2'"),
    "format true": (header_with("format", True), "format", "True"),
    "format unknown": (header_with("format", 7), "format 7", "reads 1 and 2"),
    "robot a number": (header_with("robot", 7), "robot", "7"),
    "robot unknown": (header_with("robot", "tank"), "tank", "kinematic"),
    "dictionary a list": (header_with("dictionary", []), "dictionary", "[]"),
    "observables a number": (header_with("observables", 5), "observables", "5"),
    "observables numbers": (header_with("observables", [1, 2]), "observables.0", "1"),
    "expressions a number": (header_with("expressions", 5), "expressions", "5"),
    "combination a list": (header_with("combination", ["paper"]), "combination", "paper"),
    "predictor a number": (header_with("predictor", 3), "predictor", "3"),
    "metadata a list": (header_with("metadata", []), "metadata", "[]"),
    "metadata null": (header_with("metadata", None), "metadata", "None"),
    "data a list": (header_with("metadata.data", [1]), "metadata.data", "[1]"),
    "marker text": (header_with("metadata.data.marker", "x"), "metadata.data.marker", "'x'"),
    "marker of two": (header_with("metadata.data.marker.offset", [0.0, 0.1]), "marker.offset"),
    "marker of text": (header_with("metadata.data.marker.offset", ["a"] * 3), "offset.0", "'a'"),
    "window text": (header_with("metadata.data.processing.smoothing_window", "40"),
                    "smoothing_window", "'40'"),
    "removed or not": (header_with("metadata.data.processing.remove_marker_offset", 1),
                       "remove_marker_offset", "1"),
    "radius text": (header_with("metadata.data.robot.wheel_radius_m", "x"), "wheel_radius_m"),
    "radius zero": (header_with("metadata.data.robot.wheel_radius_m", 0.0), "wheel_radius_m"),
    "data null": (header_with("metadata.data", None), "metadata", "data is null"),
    "marker null": (header_with("metadata.data.marker", None), "metadata.data", "marker is null"),
    "verdict text": (header_with("metadata.verdict", "good"), "metadata.verdict", "'good'"),
    "sources a table": (header_with("metadata.verdict.sources", {}), "verdict.sources", "{}"),
    "reasons": (header_with("metadata.verdict.sources",
                            [{"data": {"level": "good", "reasons": REASONS}}]), "text", "3"),
}  # fmt: skip


@pytest.mark.parametrize("damage", MODEL_DAMAGES)
def test_a_model_is_refused_by_its_entry(damage, tmp_path):
    change, *expected = MODEL_DAMAGES[damage]
    header, arrays = entries(MODEL)
    for part in ("marker", "processing", "robot"):
        header["metadata"]["data"].setdefault(part, {})
    change(header, arrays)
    write(tmp_path / "model.npz", header, arrays)
    refused(ModelError, load_model, tmp_path / "model.npz", *expected)


def refused(error, read, path, *expected):
    with pytest.raises(error) as caught:
        read(path)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 500
    for text in (path.name, *expected):
        assert text in message
    assert caught.value.__suppress_context__ or caught.value.__context__ is None


DATA_DAMAGES = {
    "not a number": (array_with("X_1", lambda x: with_value(x, (3, 1), np.nan)), "X_1", "[3, 1]"),
    "one pair less": (array_with("Y_2", lambda y: y[1:]), "Y_2", "shape"),
    "one state less": (array_with("X_1", lambda x: x[:, 1:]), "X_1", "3)"),
    "of real numbers": (array_with("segments_1", lambda s: s + 0.5), "segments_1", "float64"),
    "basis input too short": (array_with("basis_inputs_1", lambda u: u[:1]), "basis_inputs_1"),
    "no successor": (without("Y_1"), "Y_1", "no such entry"),
    "index text": (header_with("indices", ["1", "2"]), "indices.0", "'1'"),
    "index negative": (header_with("indices", [-1]), "indices.0", "-1"),
    "indices a number": (header_with("indices", 2), "indices", "2"),
    "index of nothing": (header_with("indices", [1, 2, 3]), "X_3", "no such entry"),
    "dt not a number": (header_with("dt_s", float("nan")), "dt_s"),
    "robot a list": (header_with("robot_kind", ["kinematic"]), "robot_kind"),
    "robot unknown": (header_with("robot_kind", "tank"), "tank", "kinematic"),
    "metadata text": (header_with("metadata", "none"), "metadata", "'none'"),
    "account a list": (header_with("metadata.session", [1]), "metadata.session"),
    "account empty": (header_with("metadata.session", {}), "metadata.session"),
    "marker without how": (header_with("metadata.marker", {"offset": None, "standard_error": None,
                           "rotations": 0, "drives": 0, "reason": ""}), "metadata", "processed"),
    "source a number": (header_with("metadata.source", 3), "metadata.source"),
    "a model": (lambda _, arrays: arrays.update(matrices=np.eye(2)), "a model"),
}  # fmt: skip


@pytest.mark.parametrize("damage", DATA_DAMAGES)
def test_a_data_set_is_refused_by_its_entry(damage, tmp_path):
    ideal_dataset("kinematic").save(tmp_path / "data.npz")
    change, *expected = DATA_DAMAGES[damage]
    header, arrays = entries(tmp_path / "data.npz")
    change(header, arrays)
    write(tmp_path / "data.npz", header, arrays)
    refused(DataError, DataSet.load, tmp_path / "data.npz", *expected)


HEADERS = {
    "no JSON": b"{",
    "no text": b"\xff\xfe",
    "a list": b"[]",
    "nested without end": b"[" * 100_000,
    "nested tables": b'{"a":' * 5000 + b"1" + b"}" * 5000,
    "a number without end": b'{"format": ' + b"9" * 100_000 + b"}",
    "nothing": b"",
}


@pytest.mark.parametrize("text", HEADERS.values(), ids=HEADERS)
def test_a_header_that_is_no_table_is_refused(text, tmp_path):
    write(tmp_path / "model.npz", text, {})
    refused(ModelError, load_model, tmp_path / "model.npz", "header")


def head(shape, dtype="<f8"):
    """Return an array's header that says a shape, and nothing behind it."""
    text = io.BytesIO()
    facts = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(text, facts)
    return text.getvalue()


ARRAYS = {
    "a shape without numbers": head((1 << 40,)),
    "a shape beyond all memory": head((1 << 60, 1 << 60)),
    "numbers without a shape": head((1,)) + bytes(80),
    "a negative shape": head((-1,)) + bytes(8),
    "objects": npy(np.array([{}, []], dtype=object)),
    "records": npy(np.zeros(3, [("a", "<f8")])),
    "another format": b"\x93NUMPY\x09\x00" + bytes(100),
    "no array": b"text",
    "nothing": b"",
    "a header that is no Python": b"\x93NUMPY\x01\x00\x08\x00{'descr'",
    "a header nested without end": b"\x93NUMPY\x01\x00\x10\x27" + b"(" * 10_000,
}


@pytest.mark.parametrize("content", ARRAYS.values(), ids=ARRAYS)
def test_what_an_array_says_of_itself_is_held_against_its_bytes(content, tmp_path):
    path = tmp_path / "model.npz"
    zipped(path, {"header.npy": npy(np.frombuffer(b"{}", np.uint8)), "matrices.npy": content})
    tracemalloc.start()
    try:
        refused(ModelError, read_model_file, path)
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()


def test_an_archive_that_unpacks_to_too_much_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "model.npz"
    zipped(path, {f"{i}.npy": bytes(10_000_000) for i in range(20)}, zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < 1e6
    tracemalloc.start()
    try:
        refused(ModelError, read_model_file, path, "unpack to 200000000")
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()


def test_names_of_entries_are_shown_as_a_terminal_may_show_them(tmp_path):
    path = tmp_path / "model.npz"
    zipped(path, {"\x1b[2J\n" + "x" * 5000: b"text"})
    refused(ModelError, read_model_file, path, "magic")
    zipped(path, {"\x1b[2J\n" + "x" * 5000: npy(np.array([np.nan]))})
    refused(ModelError, read_model_file, path, r"\x1b[2J\nxxx", "finite numbers")


def test_many_entries_two_of_a_name_and_a_wrong_checksum_are_refused(tmp_path):
    path = tmp_path / "model.npz"
    zipped(path, {f"{i}.npy": b"" for i in range(5000)})
    refused(ModelError, read_model_file, path, "5000 entries")
    zipped(path, {"a.npy": b"", "a": b""})
    refused(ModelError, read_model_file, path, "2 entries of 1 names")
    content = bytearray(MODEL.read_bytes())
    with zipfile.ZipFile(MODEL) as archive:
        place = archive.getinfo("matrices.npy").header_offset + 300
    content[place] ^= 1
    path.write_bytes(content)
    refused(ModelError, read_model_file, path, "Bad CRC-32")


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "folder.npz").mkdir()
    for path in (Path("/dev/zero"), tmp_path / "pipe.npz", tmp_path / "folder.npz"):
        refused(ModelError, read_model_file, path, "no file")
        refused(DataError, DataSet.load, path, "no file")
        with pytest.raises(OSError, match="no file"):
            open_file(path)


def test_arrays_come_as_numpy_reads_them(tmp_path):
    arrays = {
        "big_endian": np.arange(6, dtype=">f4").reshape(2, 3),
        "columns_first": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "nothing": np.zeros((0, 3)),
        "scalar": np.array(7),
    }
    write(tmp_path / "some.npz", {}, arrays)
    refusal = Refusal(tmp_path / "some.npz", "a model", "train one", LabError)
    read = read_array_file(refusal).arrays
    assert read.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(read[name], array)
        assert read[name].dtype.isnative
    rows = [ArrayRow("big_endian", "real", (2, "n")), ArrayRow("nothing", "real", ("d", "n"))]
    checked = checked_arrays(refusal, read, rows)
    assert {array.dtype for array in checked.values()} == {np.dtype(np.float64)}
