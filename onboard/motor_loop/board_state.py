"""What the board keeps of a robot: its one motor loop, and which stop holds it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.file_lock import LockHeldError, held
from koopman_lab.files import STATE_VARIABLE, state_folder, sync_folder, write_json
from onboard.motor_loop.stop_keeper import StopRecord

FOLDER = "stops"
LARGEST_NUMBER = 1 << 62
"""What a clock of microseconds never reaches, and a message can say."""
FIELDS = {"stop_number": int, "holds": bool, "fault": int}


class StopFile:
    """The record of one robot's stop, a small file of JSON.

    Parameters
    ----------
    file
        Where it is.
    say
        Is told, once for each reason, why it cannot be read or written.
    """

    def __init__(self, file: Path, say: Callable[[str], None]) -> None:
        self._file, self._say = file, say
        self._said: set[str] = set()

    def read(self) -> StopRecord | None:
        """Return the record, None for a robot that was never stopped.

        Raises
        ------
        LabStateError
            If it is damaged or cannot be read, or its folder could not take one.
        """
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=self._file.parent) as trial:
                trial.write(b"0")
                trial.flush()
            text = self._file.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise self._error("cannot be read or written", error) from None
        try:
            return _parse(text)
        except (ValueError, TypeError, RecursionError) as error:
            raise self._error("is damaged", error) from None

    def write(self, record: StopRecord) -> None:
        """Write the record, whole or not at all; it is on the disk when this returns.

        Raises
        ------
        LabStateError
            If it cannot be written.
        """
        values = dict(zip(FIELDS, (record.number, record.holds, int(record.fault)), strict=True))
        try:
            write_json(self._file, values)
            sync_folder(self._file.parent)
        except OSError as error:
            raise self._error("cannot be written", error) from None

    def _error(self, what: str, why: Exception) -> LabStateError:
        text = (
            f"{self._file}: {what} ({why}), so that a restart would not know of a stop; mend it, "
            f"or name another folder in {STATE_VARIABLE}"
        )
        if text not in self._said:
            self._said.add(text)
            self._say(text)
        return LabStateError(text)


@contextlib.contextmanager
def only_motor_loop(config: LabConfig, say: Callable[[str], None]) -> Iterator[StopFile]:
    """Run the one motor loop of a robot on this machine in the block; give the record of its stop.

    Parameters
    ----------
    config
        Names robot and bus: robots of one name on two buses are two.
    say
        Is told why no stop can be kept.

    Raises
    ------
    LabStateError
        If another process of this machine runs the robot's motor loop.
    """
    folder, name = state_folder() / FOLDER, _file_name(config)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held(folder / f"{name}.lock"))
        except LockHeldError as holder:
            robot = config.robot.name
            raise LabStateError(
                f"{holder} runs the onboard program of {robot} already on {config.bus.url}; end it "
                "first, or take another name with --robot-name R2"
            ) from None
        except OSError:
            # Reading the record fails as well, which holds the robot and says why.
            pass
        yield StopFile(folder / f"{name}.json", say)


def _file_name(config: LabConfig) -> str:
    """Return the robot's name, for a person, and what tells it from those on other buses."""
    # Where a bus is, not how: options such as ttl make no other robot.
    bus = config.bus.url.partition("?")[0]
    key = hashlib.sha256(f"{bus}\0{config.robot.name}".encode()).hexdigest()[:16]
    return f"{re.sub(r'[^A-Za-z0-9]', '_', config.robot.name)[:32]}-{key}"


def _parse(text: str) -> StopRecord:
    """Return a record.

    Raises
    ------
    ValueError
        If the text holds none.
    """
    values = json.loads(text)
    if not isinstance(values, dict) or values.keys() != FIELDS.keys():
        raise ValueError(f"expected {', '.join(FIELDS)}")
    for field, kind in FIELDS.items():
        if type(values[field]) is not kind:
            raise ValueError(f"{field} is {values[field]!r}")
    record = StopRecord(values["stop_number"], values["holds"], Fault(values["fault"]))
    if not -LARGEST_NUMBER < record.number < LARGEST_NUMBER:
        raise ValueError(f"stop_number is {record.number}")
    return record
