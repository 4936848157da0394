"""`scripts/fuzz` runs a target for a while, and keeps what it stumbled over as small as it gets."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from fuzzing.mutations import changed_bytes
from fuzzing.targets import TARGETS, Target

from koopman_lab.errors import DataError

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "fuzz_readers.py"


@pytest.fixture
def fuzzer(tmp_path, monkeypatch):
    """Return the script as a module whose corpus is one file, and its target's reader to be set."""
    spec = importlib.util.spec_from_file_location("fuzz_readers", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (tmp_path / "bytes").mkdir()
    (tmp_path / "bytes" / "whole").write_bytes(b"a good file")
    monkeypatch.setattr(module, "CORPUS", tmp_path)
    monkeypatch.setattr("fuzzing.targets.CORPUS", tmp_path)

    def run(read):
        monkeypatch.setitem(TARGETS, "own", Target(read, changed_bytes, "bytes"))
        return module.fuzz("own", 0.2)

    return run


def test_expected_mistakes_are_survived(fuzzer, tmp_path, capsys):
    def read(place, content):
        del place
        raise DataError(f"{len(content)} bytes")

    assert fuzzer(read)
    assert "own: survived " in capsys.readouterr().out
    assert [file.name for file in (tmp_path / "bytes").iterdir()] == ["whole"]


def test_anything_else_is_a_find_that_stays_in_the_corpus(fuzzer, tmp_path, capsys):
    def read(place, content):
        del place
        if len(content) < 8:
            raise KeyError("short")

    assert not fuzzer(read)
    said = capsys.readouterr().out
    assert "own: stumbled over" in said
    assert "KeyError: 'short'" in said
    (find,) = (tmp_path / "bytes").glob("find-*")
    assert len(find.read_bytes()) < 8


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("summary", "outcome", "--minutes", "0.01"), 0, "outcome: survived"),
        (("nothing",), 2, "no such target; there are event-log"),
    ],
)
def test_by_hand_targets_are_named(arguments, code, words):
    path = {"PYTHONPATH": str(ROOT / "tests" / "support")}
    command = [sys.executable, SCRIPT, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=path)
    assert done.returncode == code, done.stderr
    assert words in " ".join((done.stdout + done.stderr).split())
