"""What the commands of this machine note of the processes they start, for whoever asks later.

A command that ends as it should takes its note away. What is left tells of a lab that broke: of a
process that died, or of a command that was killed itself and could say nothing any more. The next
lab of the same robot on the same bus takes the place of such notes.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

import lcmtypes
from koopman_lab.bus.processes import in_stop_order
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError, LabStateError
from koopman_lab.files import cache_folder, is_private, write_json
from koopman_lab.json_file import JsonTable, Refusal, read_table
from koopman_lab.units import US_PER_S
from offboard.lab.own_processes import alive, is_klab
from offboard.lab.run_folder import RunFolder
from offboard.monitor.process_states import ALIVE, DIED, STARTING, ProcessState

FOLDER = "labs"
"""In the user's cache folder."""
TAIL_LINES = 12
FORGOTTEN_S = 7 * 86_400.0
"""After a week a lab that broke, and was never started again, is news to nobody."""
ProcessNumber = Annotated[int, Field(gt=0, lt=1 << 31)]


class _Death(JsonTable):
    """Which process ended a lab, how, and when (us)."""

    name: str
    ended: str
    utime: int


class _Note(JsonTable):
    """What a note says."""

    bus: str
    robot: str
    host: str
    supervisor_pid: ProcessNumber
    folder: str
    processes: dict[str, ProcessNumber]
    died: _Death | None


class ProcessNote:
    """What one command notes of the processes it starts for a robot.

    Parameters
    ----------
    config
        Names bus and robot.
    folder
        Takes what the processes say.
    """

    def __init__(self, config: LabConfig, folder: RunFolder) -> None:
        key = lab_key(config)
        self._file = cache_folder() / FOLDER / f"{key}-{os.getpid()}.json"
        self._facts: dict[str, Any] = {
            "bus": config.bus.url,
            "robot": config.robot.name,
            "host": socket.gethostname(),
            "supervisor_pid": os.getpid(),
            "folder": str(folder.path.absolute()),
            "processes": {},
            "died": None,
        }

    def started(self, name: str, pid: int) -> None:
        """Note a process; the first one takes the place of what broke before."""
        if not self._facts["processes"]:
            for file, note in _notes_left_behind(self._facts["bus"]):
                if note.robot == self._facts["robot"]:
                    file.unlink(missing_ok=True)
        self._facts["processes"][name] = pid
        self._write()

    def died(self, name: str, ended: str, now_us: int) -> None:
        """Note the process that ended the lab, and how."""
        self._facts["died"] = {"name": name, "ended": ended, "utime": now_us}
        self._write()

    def close(self) -> None:
        """Take the note away, unless a process died."""
        if self._facts["died"] is None:
            with contextlib.suppress(OSError):
                self._file.unlink(missing_ok=True)

    def _write(self) -> None:
        # A lab runs as well where this folder cannot be written; only nobody can ask later.
        with contextlib.suppress(OSError):
            write_json(self._file, self._facts, mode=0o600)


def running_commands(url: str) -> dict[str, dict[int, set[str]]]:
    """Return by robot the commands of this machine that run its processes on a bus now.

    Each is known by its process number; with it stands which processes it has started.
    """
    by_robot: dict[str, dict[int, set[str]]] = {}
    for file in (cache_folder() / FOLDER).glob("*.json"):
        note = _read(file)
        if note is None or note.bus != url or note.host != socket.gethostname():
            continue
        if alive(note.supervisor_pid) and is_klab(note.supervisor_pid):
            by_robot.setdefault(note.robot, {})[note.supervisor_pid] = set(note.processes)
    return by_robot


def may_run(pid: int, url: str, robot: str) -> bool:
    """Return whether a command's own notes allow that it runs processes of a robot on a bus.

    Only a command without any note, whose folder could not be written, may run anybody's.
    """
    claims = set()
    for file in (cache_folder() / FOLDER).glob(f"*-{pid}.json"):
        note = _read(file)
        if note is not None:
            claims.add((note.bus, note.robot))
    return not claims or (url, robot) in claims


def broken_labs(url: str, now_us: int) -> dict[str, list[ProcessState]]:
    """Return by robot the processes of labs on a bus that broke on this machine.

    Parameters
    ----------
    url
        Of the bus.
    now_us
        Present time (us).
    """
    states_by_robot: dict[str, list[ProcessState]] = {}
    for _, note in _notes_left_behind(url):
        entries = states_by_robot.setdefault(note.robot, [])
        folder, died = RunFolder(Path(note.folder)), note.died
        killed_text = f"killed with process {note.supervisor_pid}, which had started it"
        for row in in_stop_order():
            pid = note.processes.get(row.name)
            if pid is None or (died is not None and died.name != row.name):
                continue  # the others were ended in order, because this one died
            log = folder.process_log(row.name)
            ended, utime = (killed_text, _last_written_us(folder.log, log)) if died is None else (
                died.ended, died.utime
            )  # fmt: skip
            report = lcmtypes.process_t()
            report.utime, report.name, report.pid = utime, row.name, pid
            report.state, report.ended, report.log_file = report.DIED, ended, str(log)
            report.host, report.supervisor_pid = socket.gethostname(), note.supervisor_pid
            report.last_lines = "\n".join(last_lines(log))
            no_heartbeat = (None, None, None)
            age_s = (now_us - utime) / US_PER_S
            if age_s > FORGOTTEN_S:
                continue
            entries.append(
                ProcessState(
                    row.name, DIED, pid, age_s, *no_heartbeat, row.needs, row.stopped_by, report
                )
            )
    return states_by_robot


def with_broken_labs(
    heard: dict[str, list[ProcessState]], broken: dict[str, list[ProcessState]]
) -> dict[str, list[ProcessState]]:
    """Return who is heard, and beside them who is not any more because it broke.

    Who speaks and was started by hand has taken the place of what broke. A command would have taken
    the note away: what it says of its processes is about others of the same name.
    """
    merged = {name: list(entries) for name, entries in heard.items()}
    for robot, entries in broken.items():
        present = merged.get(robot, [])
        restarted = {e.name for e in present if e.state == ALIVE and e.report is None}
        known_pids = {e.pid for e in present if e.state in (ALIVE, DIED)}
        missing = [e for e in entries if e.name not in restarted and e.pid not in known_pids]
        names = {e.name for e in missing}
        kept = [e for e in present if e.state in (ALIVE, STARTING, DIED) or e.name not in names]
        if missing:
            merged[robot] = kept + missing
    return merged


def last_lines(file: Path) -> list[str]:
    """Return how the file of a process ends; nothing where it is gone."""
    try:
        return file.read_text(errors="replace").splitlines()[-TAIL_LINES:]
    except OSError:
        return []


def _notes_left_behind(url: str) -> Iterator[tuple[Path, _Note]]:
    """Give the notes on a bus whose command has ended, but not as it should, or whose lab has."""
    for file in sorted((cache_folder() / FOLDER).glob("*.json")):
        note = _read(file)
        if note is None or note.bus != url:
            continue
        if note.died or not (alive(note.supervisor_pid) and is_klab(note.supervisor_pid)):
            yield file, note


def _read(file: Path) -> _Note | None:
    """Return a note; None if another version or user wrote it, or it was just taken away."""
    with contextlib.suppress(LabError, OSError):
        if is_private(file.stat()):
            return read_table(Refusal(file, "a note", "it is left alone", LabStateError), _Note)
    return None


def lab_key(config: LabConfig) -> str:
    """Return what names the files of a robot on a bus."""
    return hashlib.sha256(f"{config.bus.url}\0{config.robot.name}".encode()).hexdigest()[:16]


def _last_written_us(*files: Path) -> int:
    """Return when one of these was last written (us), 0 where none is left."""
    times_ns = []
    for file in files:
        with contextlib.suppress(OSError):
            times_ns.append(file.stat().st_mtime_ns)
    return max(times_ns, default=0) // 1000
