"""The readers of files of others, each with what is done with a file that it takes.

Nothing but an expected mistake may leave one.
"""

import contextlib
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from fuzzing.mutations import changed_bytes, changed_json, changed_lines, changed_npz

import lcmtypes
from koopman_lab.bus.channels import CHANNELS, SESSION_INFO
from koopman_lab.bus.header import header_reader
from koopman_lab.bus.pacing import load_tick_times
from koopman_lab.config.load import parse_config
from koopman_lab.data.dat import read_folder
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.message_arrays import decode_all, decode_each, wire_dtype
from koopman_lab.errors import LabError
from koopman_lab.evaluation.describe import describe
from koopman_lab.evaluation.fit_to_drive import stored_reasons
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.eventlog.message_blocks import Messages
from koopman_lab.eventlog.older_layouts import in_present_layout
from koopman_lab.eventlog.seal import changes
from koopman_lab.files import CACHE_VARIABLE
from koopman_lab.koopman.trainer import train
from koopman_lab.mpc import compiled
from koopman_lab.predictors.table import load_model
from koopman_lab.replay.rotated_log import read_rotated_log
from koopman_lab.studies.parking import COLUMNS
from koopman_lab.studies.result_cache import whole_rows
from offboard.desk.results import CalibrationOutcome
from offboard.lab.process_notes import broken_labs, running_commands
from offboard.lab.session_runner import read_outcome
from offboard.reproduction.step_runner import MARKER, Step, finished

CORPUS = Path(__file__).parents[2] / "fuzz_corpus"
URL = "udpm://239.255.76.67:7667?ttl=0"


@dataclass(frozen=True)
class Target:
    """A reader.

    ``read`` is given a folder of its own and the bytes of a file; ``changed`` maps whole bytes, and
    those of other files of the corpus, to a strategy of damaged ones. ``corpus`` names its folder.
    """

    read: Callable[[Path, bytes], None]
    changed: Callable
    corpus: str

    @property
    def seeds(self) -> list[bytes]:
        """Return the files of its corpus."""
        return [file.read_bytes() for file in sorted((CORPUS / self.corpus).iterdir())]


def event_log(place, content):
    path = place / "session.lcm"
    path.write_bytes(content)
    for salvage in (False, True):
        with contextlib.suppress(LabError):
            log = SessionLog(path, salvage=salvage)
            assert log.duration_s is not None
            assert log.passed_over is not None
            assert log.robot_name
            for channel in CHANNELS:
                if wire_dtype(channel.type) is not None:
                    log.array(channel, needed=False)
                else:
                    log.messages(channel)
            log.config()
        with contextlib.suppress(LabError):
            read_rotated_log(path, salvage=salvage)


def message(place, content):
    del place
    in_present_layout(content)
    for channel in CHANNELS:
        header = header_reader(channel.type)(content)
        one = Messages.joined([content])
        _, bad = decode_each(channel.type, one)
        assert len(bad) or header is not None
        if wire_dtype(channel.type) is not None:
            decoded, bad_too = decode_all(channel.type, one)
            assert len(decoded) + len(bad_too) == 1


def session_info(place, content):
    info = lcmtypes.session_info_t()
    info.config_yaml = content.decode(errors="replace")
    path = place / "session.lcm"
    path.unlink(missing_ok=True)
    with EventLogWriter(path) as log:
        log.write(SESSION_INFO.name("R1"), info.encode(), 0)
    SessionLog(path).config()


def config(place, content):
    del place
    parse_config(content.decode(errors="replace"), "a text")


def model(place, content):
    path = place / "model.npz"
    path.write_bytes(content)
    read = load_model(path)
    list(stored_reasons(read))
    assert read.marker_offset is not None
    model_verdict(read)


def data_set(place, content):
    path = place / "data.npz"
    path.write_bytes(content)
    dataset = DataSet.load(path)
    describe(dataset, {"kinematic": "D5t", "dynamic": "D8Eul"}[dataset.robot_kind])
    dataset.save(place / "again.npz")
    assert DataSet.load(place / "again.npz").data_hash == dataset.data_hash


def columns(place, content):
    folder = place / "columns"
    if not folder.exists():
        shutil.copytree(CORPUS / "columns-of-others", folder)
    (folder / "X_1.dat").write_bytes(content)
    read_folder(folder, "kinematic", 0.05)


def pairs(place, content):
    folder = place / "pairs"
    if not folder.exists():
        shutil.copytree(CORPUS / "columns-of-others", folder)
    (folder / "pairs_1.dat").write_bytes(content)
    dataset = read_folder(folder, "kinematic", 0.05)
    with contextlib.suppress(LabError):
        train(dataset, "D5t")
    describe(dataset, "D5t")


def published_header(place, content):
    folder = place / "published"
    if not folder.exists():
        shutil.copytree(CORPUS / "columns-of-others", folder)
    (folder / "dataset.json").write_bytes(content)
    describe(read_folder(folder), "D5t")


def summary(place, content):
    (place / "session.lcm").write_bytes(b"")
    (place / "summary.json").write_bytes(content)
    changes(place)


def outcome(place, content):
    (place / "outcome.json").write_bytes(content)
    read_outcome(place / "outcome.json", CalibrationOutcome)


def compiled_note(place, content):
    library = place / "library.so"
    if not library.exists():
        library.write_bytes(b"any bytes")
        library.chmod(0o700)
    note = compiled.note_of(library)
    note.write_bytes(content)
    note.chmod(0o600)
    whole = (CORPUS / "compiled-note" / "whole").read_bytes()
    assert (compiled.fault_of(library) is None) == (content[: len(whole)] == whole)


def tick_times(place, content):
    (place / "ticks.npy").write_bytes(content)
    assert load_tick_times(place / "ticks.npy").ndim == 1


def study_rows(place, content):
    (place / "rows.jsonl").write_bytes(content)
    for row in whole_rows(place / "rows.jsonl", set(COLUMNS)):
        assert (row["case"], row["index"]) is not None


def step_marker(place, content):
    (place / "step").mkdir(exist_ok=True)
    (place / "step" / MARKER).write_bytes(content)
    finished(place, [Step("step", ("log", "info", "x"))])


def process_note(place, content):
    (place / "labs").mkdir(exist_ok=True)
    note = place / "labs" / "note.json"
    note.write_bytes(content)
    note.chmod(0o600)
    with mock.patch.dict(os.environ, {CACHE_VARIABLE: str(place)}):
        running_commands(URL)
        broken_labs(URL, 0)


TARGETS = {
    "event-log": Target(event_log, changed_bytes, "event-log"),
    "message": Target(message, changed_bytes, "message"),
    "session-info": Target(session_info, changed_lines, "config"),
    "config": Target(config, changed_lines, "config"),
    "model": Target(model, changed_npz, "model"),
    "data-set": Target(data_set, changed_npz, "data-set"),
    "columns": Target(columns, changed_lines, "columns"),
    "pairs": Target(pairs, changed_lines, "pairs"),
    "published-header": Target(published_header, changed_json, "published-header"),
    "summary": Target(summary, changed_json, "summary"),
    "outcome": Target(outcome, changed_json, "outcome"),
    "compiled-note": Target(compiled_note, changed_bytes, "compiled-note"),
    "tick-times": Target(tick_times, changed_bytes, "tick-times"),
    "study-rows": Target(study_rows, changed_json, "study-rows"),
    "step-marker": Target(step_marker, changed_json, "step-marker"),
    "process-note": Target(process_note, changed_json, "process-note"),
}
"""By name, as `scripts/fuzz NAME` runs them."""


def survive(target, place, content):
    """Give bytes to a reader; expected mistakes are its right."""
    with contextlib.suppress(LabError):
        target.read(place, content)
