"""Writes files that appear whole or not at all, opens and names files, knows a user's folders."""

from __future__ import annotations

import contextlib
import csv
import errno
import hashlib
import io
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Container, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any
from urllib.parse import quote

from koopman_lab.errors import DiskError, NotWrittenError

CACHE_VARIABLE = "KOOPMAN_LAB_CACHE"
"""Environment variable that names another cache folder."""
LONGEST_NAME = 200
"""Bytes of a file's name, without its ending; file systems take 255."""


def cache_folder() -> Path:
    """Return the user's folder for what can be made again, and for notes of running labs."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen)
    shared = os.environ.get("XDG_CACHE_HOME")
    return (Path(shared) if shared else Path.home() / ".cache") / "koopman-lab"


STATE_VARIABLE = "KOOPMAN_LAB_STATE"
"""Environment variable that names another folder for what must not be forgotten."""


def state_folder() -> Path:
    """Return the user's folder for what must outlast the programs: which robot is stopped."""
    chosen = os.environ.get(STATE_VARIABLE)
    if chosen:
        return Path(chosen)
    shared = os.environ.get("XDG_STATE_HOME")
    return (Path(shared) if shared else Path.home() / ".local" / "state") / "koopman-lab"


@contextlib.contextmanager
def replacing(path: Path, mode: int = 0o666) -> Iterator[IO[bytes]]:
    """Open a temporary file beside ``path`` that takes its place when the block ends well.

    Parameters
    ----------
    path
        The file.
    mode
        Who may read and write it, as far as the user's umask lets them.

    Raises
    ------
    DiskError
        If it cannot be written.
    """
    with _in_words(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            # mkstemp makes files only their owner can read; results are for everybody.
            temporary.chmod(mode & ~_umask())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder beside ``path`` that takes its place when the block ends well.

    ``path`` must not exist, or be an empty folder.

    Raises
    ------
    DiskError
        If it is not, or cannot be made.
    """
    with _in_words(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}."))
        try:
            yield temporary
            # As in `replacing`.
            temporary.chmod(0o777 & ~_umask())
            temporary.replace(path)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise


def open_file(path: Path) -> IO[bytes]:
    """Open a file to read; what never ends, such as a device or a pipe, is none.

    Raises
    ------
    OSError
        If there is no such file, or it cannot be read.
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "is a folder or a device, no file", str(path))
    return path.open("rb")


def is_private(facts: os.stat_result) -> bool:
    """Return whether nobody but this user and root can write a file or folder."""
    return facts.st_uid in (0, os.geteuid()) and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def file_name(text: str, taken: Container[str] = ()) -> str:
    """Return a file's name that stands for a text from elsewhere: one name, and never a path.

    Letters, digits and ``_.-~`` stand for themselves, anything else for its bytes in hexadecimal
    (``%2F``), and so does a dot in front. Different texts give different names also where a file
    system does not tell upper from lower case, as long as ``taken`` holds the names given before,
    in lower case.

    Parameters
    ----------
    text
        For example the name of a channel.
    taken
        Names that must not be returned, whatever their case.
    """
    name = quote(text, safe="", errors="surrogatepass")
    name = f"%2E{name[1:]}" if name.startswith(".") else name
    whole = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:16]
    if not name or len(name) > LONGEST_NAME or name.lower() in taken:
        name = f"{name[: LONGEST_NAME - len(whole) - 1]}-{whole}"
    return name


@contextlib.contextmanager
def _in_words(path: Path) -> Iterator[None]:
    """Say of what cannot be written which file, and why."""
    try:
        yield
    except DiskError:
        raise
    except OSError as error:
        raise DiskError(error.errno, error.strerror or str(error), str(path)) from None


@contextlib.contextmanager
def writing_where_named(
    path: Path, next_step: str = "choose another place with --out"
) -> Iterator[None]:
    """Say of a place that a person named that it cannot be written, and what to do then.

    Raises
    ------
    NotWrittenError
        If what is done within fails as the disk or the folder refuses it.
    """
    try:
        yield
    except OSError as error:
        raise NotWrittenError(
            f"{path}: cannot be written ({error.strerror}); {next_step}"
        ) from None


def write_text(path: Path, text: str, mode: int = 0o666) -> None:
    """Write a text file whole or not at all; ``mode`` as for :func:`replacing`."""
    with replacing(path, mode) as file:
        file.write(text.encode())


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table with a line of column names, whole or not at all."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    write_text(path, table.getvalue())


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the names of a folder's files, as `replacing` gave them."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sha256(*paths: Path) -> str:
    """Return the SHA-256 of what files hold, one after the other.

    Raises
    ------
    OSError
        If one cannot be read.
    """
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def write_json(path: Path, value: Any, mode: int = 0o666) -> None:
    """Write a JSON file whole or not at all; ``mode`` as for :func:`replacing`."""
    write_text(path, json.dumps(value, indent=2) + "\n", mode)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
