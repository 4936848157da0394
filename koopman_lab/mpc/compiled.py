"""Libraries from generated C code, kept in the user's cache folder under a hash of their source.

A compiler is used where there is one and never required: whoever asks for a library must be able
to go on without it.

Loading a library runs it, so none is loaded that is not what was built: a note beside it says its
hash, and both belong to the user alone. What is not so is built again.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import platform
import shutil
import stat
import subprocess
import tempfile
from pathlib import Path

from koopman_lab.files import cache_folder, is_private, open_file, sha256

COMPILERS = ("cc", "gcc", "clang")
# Contraction would make the last digits depend on the machine's instruction set.
FLAGS = ("-O3", "-ffp-contract=off", "-w", "-fPIC", "-shared")
FOLDER = "compiled"
"""In the user's cache folder; nobody else may write there."""
LARGEST_BYTES = 1 << 26
"""Assumption: of a library; those of the paper's controllers have 0.2 MB."""
LONGEST_S = 120.0
MOST_OUTPUT_CHARACTERS = 200
"""Characters of what the compiler says that go into a message."""


class NotCompiledError(Exception):
    """There is no library; the message says why. Not a mistake of the user's."""


def find_compiler() -> str | None:
    """Return the C compiler that the environment variable CC names, or the first one found."""
    chosen = os.environ.get("CC")
    names = (chosen,) if chosen else COMPILERS
    return next(filter(None, map(shutil.which, names)), None)


def library(source: str) -> Path:
    """Return the library of C code, compiled now unless it has been before.

    One that is damaged, or that others could have changed, is built again, and a warning logged.

    Raises
    ------
    NotCompiledError
        If there is no compiler, it fails, or the cache folder cannot be written or is another
        user's.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NotCompiledError("no C compiler")
    kind = "\0".join((platform.system(), platform.machine(), compiler, *FLAGS, source))
    folder = cache_folder() / FOLDER
    path = folder / f"{hashlib.sha256(kind.encode()).hexdigest()[:32]}.so"
    try:
        _make_private(folder)
        fault = fault_of(path)
        if fault is not None:
            if path.exists():
                logging.getLogger(__name__).warning("%s: %s; it is built again", path, fault)
            _compile(compiler, source, path)
    except OSError as error:
        raise NotCompiledError(f"{folder}: {error.strerror or error}") from None
    if not _loads(path):
        raise NotCompiledError(f"what {compiler} makes cannot be loaded")
    return path


def fault_of(path: Path) -> str | None:
    """Return why a library must not be loaded, in words; None if it is just what was built.

    Raises
    ------
    OSError
        If it cannot be read for another reason than that it is not there.
    """
    note = note_of(path)
    for file in (path, note):
        try:
            facts = file.lstat()
        except FileNotFoundError:
            return f"there is no {file.name}"
        if not stat.S_ISREG(facts.st_mode) or facts.st_size > LARGEST_BYTES:
            return f"{file.name} is a link, a folder, or too large"
        if not is_private(facts):
            return f"{file.name} could have been changed by another user"
    with open_file(note) as stated:
        hash_of_note = stated.read(2 * hashlib.sha256().digest_size)
    return None if hash_of_note == sha256(path).encode() else "it is not what was built"


def note_of(path: Path) -> Path:
    """Return the file that says the SHA-256 of a library."""
    return path.with_suffix(".sha256")


def _make_private(folder: Path) -> None:
    """Make the folder, or take others the right to write there.

    Raises
    ------
    NotCompiledError
        If it is another user's.
    OSError
        If it cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    facts = folder.lstat()
    if not stat.S_ISDIR(facts.st_mode) or facts.st_uid != os.geteuid():
        raise NotCompiledError(f"{folder}: is another user's; remove it, or set KOOPMAN_LAB_CACHE")
    if not is_private(facts):
        folder.chmod(0o700)


def _loads(path: Path) -> bool:
    """Return whether the system takes a library, as it does not where all is mounted noexec."""
    try:
        ctypes.CDLL(str(path))
    except OSError:
        return False
    return True


def _compile(compiler: str, source: str, path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".building-") as folder:
        code, built = Path(folder) / "program.c", Path(folder) / path.name
        code.write_text(source)
        command = [compiler, *FLAGS, str(code), "-o", str(built), "-lm"]
        try:
            result = subprocess.run(
                command, capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
        except subprocess.TimeoutExpired:
            raise NotCompiledError(f"{compiler} took longer than {LONGEST_S:g} s") from None
        if result.returncode != 0 or not built.exists():
            message = " ".join(result.stderr.split())[:MOST_OUTPUT_CHARACTERS]
            raise NotCompiledError(
                f"{compiler} failed: {message or f'exit code {result.returncode}'}"
            )
        built.chmod(0o700)
        note = Path(folder) / note_of(path).name
        note.write_text(sha256(built))
        note.chmod(0o600)
        # Whole or not at all, also when two processes build the same at once: if their compiler
        # does not make the same twice, whoever looks next finds it and builds again.
        note.replace(note_of(path))
        built.replace(path)
