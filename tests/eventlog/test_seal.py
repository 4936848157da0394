"""A finished session is sealed: whatever changes in its log afterwards is seen."""

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from klab import klab

from koopman_lab.config.load import load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import LogError
from koopman_lab.eventlog.logwriter import RotatingLogWriter, files_of_log
from koopman_lab.eventlog.seal import changes
from offboard.lab.run_folder import RunFolder

PARK = Path(__file__).parents[1] / "data" / "reference" / "park.lcm"


@pytest.fixture
def run(tmp_path):
    """Return the folder of a finished session whose log went on in next files."""
    folder = RunFolder(tmp_path / "run")
    folder.write_config(load_config())
    log = RotatingLogWriter(folder.log, largest_bytes=400)
    for number in range(30):
        log.write("R1_X", bytes(50), number)
    log.close()
    folder.write_summary(load_config(), {"what": "a test"})
    return folder


def test_what_is_as_it_was_is_said_to_be_whatever_is_named(run):
    assert len(files_of_log(run.log)) > 3
    assert changes(run.path) == changes(run.log) == []


@settings(
    deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_bit_of_any_file_changes_unseen(data, run):
    file = data.draw(st.sampled_from(files_of_log(run.log)[:-1]))
    content = file.read_bytes()
    damaged = bytearray(content)
    damaged[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    try:
        file.write_bytes(damaged)
        assert changes(run.path) == [
            f"{file.name}: its bytes are not those that it had when the session ended"
        ]
    finally:
        file.write_bytes(content)


def test_files_that_are_missing_cut_or_new_are_named(run):
    files = files_of_log(run.log)
    files[-1].unlink()
    files[1].write_bytes(files[1].read_bytes()[:-1])
    assert [line.partition(":")[0] for line in changes(run.path)] == [files[1].name, files[-1].name]
    shutil.copy(files[0], files[-1])
    shutil.copy(files[0], run.path / f"session-{len(files):04}.lcm")
    assert any("was not there" in line for line in changes(run.path))


SUMMARIES = {
    "no JSON": "{",
    "a list": "[]",
    "without a seal": "{}",
    "a seal of text": '{"log_files": "x"}',
    "a hash that is a number": '{"log_files": {"session.lcm": {"bytes": 3, "sha256": 4}}}',
    "of another file": '{"log_files": {"../../etc/passwd": {"bytes": 3, "sha256": ""}}}',
    "nested without end": "[" * 100_000,
}


@pytest.mark.parametrize("text", SUMMARIES.values(), ids=SUMMARIES)
def test_a_summary_that_seals_nothing_is_no_seal(text, run):
    run.summary.write_text(text)
    with pytest.raises(LogError, match=r"summary\.json"):
        changes(run.path)


def test_flipped_bits_of_a_message_are_seen_by_nothing_else(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.path.mkdir()
    shutil.copy(PARK, folder.log)
    folder.write_summary(load_config(), {})
    assert klab("log", "verify", folder.path).returncode == 0
    content = bytearray(folder.log.read_bytes())
    place = content.index(b"R1_MOCAP_POSE") + 13 + 8 + 16 + 3
    content[place] ^= 1
    folder.log.write_bytes(content)
    assert SessionLog(folder.log).passed_over == (folder.log, (), {})
    done = klab("log", "verify", folder.log)
    assert (done.returncode, done.stdout) == (1, "")
    assert "changed: session.lcm: its bytes are not those" in " ".join(done.stderr.split())
    done = klab("log", "verify", folder.log, "--json")
    assert done.returncode == 1
    assert len(json.loads(done.stdout)["changed"]) == 1
    folder.summary.unlink()
    done = klab("log", "verify", folder.log)
    assert done.returncode == 2
    assert "no seal to hold it against" in " ".join(done.stderr.split())
    done = klab("log", "verify", tmp_path / "none")
    assert (done.returncode, done.stderr.count("no such log")) == (2, 1)
