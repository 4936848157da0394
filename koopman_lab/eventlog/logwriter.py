"""Writes standard LCM event logs; :mod:`.eventlog` has the format and reads them.

A log that grows too large goes on in a next file. Files of one log are numbered in the order they
were written: ``session.lcm``, ``session-0001.lcm``, and so on; each is a log of its own.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from types import TracebackType

from koopman_lab.errors import LogError, LogNotWrittenError
from koopman_lab.eventlog.eventlog import HEADER, LONGEST_NAME, SYNC_WORD
from koopman_lab.files import open_file, replacing

BUFFER_BYTES = 1 << 16


def numbered_file(path: Path, number: int) -> Path:
    """Return the file of a log with a number; the first, 0, is ``path`` itself."""
    return path.with_name(f"{path.stem}-{number:04d}{path.suffix}") if number else path


def files_of_log(path: Path) -> list[Path]:
    """Return the files of a log in the order they were written; none if there is no log."""
    files: list[Path] = []
    while (following := numbered_file(path, len(files))).exists():
        files.append(following)
    return files


class EventLogWriter:
    """Writes one file that must not exist yet.

    What the disk takes is whole events: a write that fails is taken back.

    Parameters
    ----------
    path
        The file to make; its folder must exist.

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    """

    def __init__(self, path: Path | str) -> None:
        self.size = 0
        """Bytes written, the waiting ones included."""
        self._path = Path(path)
        self._number = 0
        self._waiting: list[bytes] = []
        self._on_disk = 0
        try:
            self._file = self._path.open("xb", buffering=0)
        except FileExistsError:
            raise LogError(f"{path}: exists already; choose another name or folder") from None
        except OSError as error:
            raise LogError(f"{path}: cannot be made: {error.strerror}") from None

    def write(self, channel: str, data: bytes, timestamp_us: int) -> int:
        """Append an event that arrived at ``timestamp_us`` (us); return the bytes it takes.

        Raises
        ------
        LogError
            If the channel name is none LCM can carry, or the disk refuses.
        """
        name = channel.encode()
        if not 1 <= len(name) <= LONGEST_NAME:
            raise LogError(
                f"{self._path}: channel name {channel!r} is {len(name)} bytes long; "
                f"LCM carries 1 to {LONGEST_NAME}"
            )
        header = HEADER.pack(SYNC_WORD, self._number, timestamp_us, len(name), len(data))
        event = header + name + data
        self._waiting.append(event)
        self._number += 1
        self.size += len(event)
        if self.size - self._on_disk >= BUFFER_BYTES:
            self.flush()
        return len(event)

    def flush(self) -> None:
        """Hand everything to the operating system, so that ending this process loses nothing.

        Raises
        ------
        LogError
            If the disk refuses; the file then ends with the last event handed over before.
        """
        unwritten = memoryview(b"".join(self._waiting))
        events, self._waiting = len(self._waiting), []
        try:
            while unwritten:
                unwritten = unwritten[self._file.write(unwritten) :]
        except OSError as error:
            self._file.truncate(self._on_disk)
            self._file.seek(self._on_disk)
            self._number -= events
            self.size = self._on_disk
            raise self._write_error(error) from None
        self._on_disk = self.size

    def sync(self) -> None:
        """Hand everything to the disk itself, so that a power failure loses nothing.

        Raises
        ------
        LogError
            If the disk refuses.
        """
        self.flush()
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._write_error(error) from None

    def check(self) -> None:
        """See whether what was written is still where it should be.

        Where the file was deleted, what it held is written there once more.

        Raises
        ------
        LogError
            If it was deleted, moved, replaced, cut, or written by others.
        """
        ours = os.fstat(self._file.fileno())
        try:
            there = self._path.stat()
        except OSError as error:
            lost = f"is gone ({error.strerror})"
            raise self._vanished(lost if ours.st_nlink else f"{lost}{self._rescued()}") from None
        if (there.st_dev, there.st_ino) != (ours.st_dev, ours.st_ino):
            raise self._vanished("is another file now")
        if there.st_size != self._on_disk:
            raise self._vanished(f"has {there.st_size} bytes instead of {self._on_disk}")

    def close(self) -> None:
        """Write everything to the disk and close the file; a second call does nothing.

        Raises
        ------
        LogError
            If the disk refuses.
        """
        if self._file.closed:
            return
        with self._file:
            self.sync()

    def __enter__(self) -> EventLogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _rescued(self) -> str:
        """Write once more what a deleted file holds, as long as it is open; return what came of it.

        Not every system lets a process do so.
        """
        try:
            held = Path(f"/proc/self/fd/{self._file.fileno()}")
            with open_file(held) as old, replacing(self._path) as again:
                shutil.copyfileobj(old, again)
        except OSError as error:
            return f", and what it held could not be written once more ({error.strerror})"
        return ", and what it held was written once more"

    def _vanished(self, how: str) -> LogError:
        return LogError(
            f"{self._path}: {how}, while a session is recorded in it; let nobody touch the folder "
            "of a session that runs, and record it again"
        )

    def _write_error(self, error: OSError) -> LogError:
        return LogNotWrittenError(
            f"{self._path}: cannot be written after {self._number} events: {error.strerror}; "
            "see whether the disk is full. What was written before is whole"
        )


class RotatingLogWriter:
    """Writes a log that goes on in a next file when one is large.

    Parameters
    ----------
    path
        The first file.
    largest_bytes
        A file that has grown so large is the last event's; the next one begins another.
    resume
        Go on behind the files that are there; otherwise there must be none.

    Raises
    ------
    LogError
        If the file cannot be made.
    """

    def __init__(self, path: Path, largest_bytes: int, *, resume: bool = False) -> None:
        self._path = path
        self._largest_bytes = largest_bytes
        self._part = len(files_of_log(path)) if resume else 0
        self._finished: dict[Path, int] = {}
        self._file = EventLogWriter(numbered_file(path, self._part))

    def write(self, channel: str, data: bytes, timestamp_us: int) -> int:
        """Append an event; see :meth:`EventLogWriter.write`."""
        written = self._file.write(channel, data, timestamp_us)
        if self._file.size >= self._largest_bytes:
            self._file.close()
            self._finished[numbered_file(self._path, self._part)] = self._file.size
            self._part += 1
            self._file = EventLogWriter(numbered_file(self._path, self._part))
        return written

    def flush(self) -> None:
        """See :meth:`EventLogWriter.flush`."""
        self._file.flush()

    def check(self) -> None:
        """See :meth:`EventLogWriter.check`; earlier files must be there, too.

        Raises
        ------
        LogError
            If one is not as it was written.
        """
        for path, size in self._finished.items():
            present = path.stat().st_size if path.exists() else "no"
            if present != size:
                raise LogError(
                    f"{path}: has {present} bytes instead of {size}, while its session goes on in "
                    "a next file; let nobody touch the folder of a session that runs, and record "
                    "it again"
                )
        self._file.check()

    def sync(self) -> None:
        """See :meth:`EventLogWriter.sync`."""
        self._file.sync()

    def close(self) -> None:
        """See :meth:`EventLogWriter.close`."""
        self._file.close()
