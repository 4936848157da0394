"""Rows of a study that are damaged on the disk are run again, and never counted."""

import json

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ideal_data import ideal_dataset

from koopman_lab.errors import ModelError
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.studies import trained_models
from koopman_lab.studies.result_cache import line_of, whole_rows
from koopman_lab.studies.trained_models import Recipe, trained

ROWS = [{"case": f"c{k % 2}", "index": k, "x2_m": 0.1 * k, "reason": None} for k in range(6)]
KEYS = set(ROWS[0])


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_text("".join(map(line_of, ROWS)))
    return path


def test_what_is_written_is_read(file):
    assert whole_rows(file, KEYS) == ROWS
    assert all(json.loads(line)["crc32"] for line in file.read_text().splitlines())


@settings(
    deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_damaged_row_counts(data, file):
    content = bytearray("".join(map(line_of, ROWS)).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(content)
    assert all(row in ROWS for row in whole_rows(file, KEYS))


def test_damage_is_said_and_costs_its_own_row_only(file, caplog):
    file.write_bytes(file.read_bytes().replace(b"0.2", b"0.9") + b'{"torn": ')
    assert whole_rows(file, KEYS) == [row for row in ROWS if row["index"] != 2]
    assert [r.getMessage() for r in caplog.records] == [
        f"{file}: 1 of 6 rows are damaged; they are run again"
    ]
    assert file.read_bytes().endswith(b"\n")


def test_what_is_no_row_or_has_no_checksum_is_run_again(tmp_path):
    path = tmp_path / "rows.jsonl"
    others = [json.dumps(ROWS[0]), line_of({"case": "c0"}).strip(), "[]", "3", "[" * 100_000, "{"]
    path.write_text("".join(f"{line}\n" for line in others) + line_of(ROWS[1]))
    assert whole_rows(path, KEYS) == [ROWS[1]]


def test_a_damaged_model_of_a_study_is_trained_again(tmp_path, caplog):
    path, dataset = tmp_path / "model.npz", ideal_dataset("kinematic")
    whole = trained(path, Recipe(), dataset, "D5t", 0, keep=False).content
    for damaged in (whole[:-10], b"", whole.replace(b"real", b"").replace(b"D5t", b"D9t")):
        path.write_bytes(damaged)
        with pytest.raises(ModelError):
            BilinearModel.load(path)
        assert trained(path, Recipe(), dataset, "D5t", 0, keep=True).content == whole
        assert caplog.records.pop().getMessage().endswith("it is trained again")
    written = path.stat().st_mtime_ns
    assert trained_models.trained(path, Recipe(), dataset, "D5t", 0, keep=True).content == whole
    assert path.stat().st_mtime_ns == written
