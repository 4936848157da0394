"""Libraries from generated C code, kept in the user's cache folder under a hash of their source.

A compiler is used where there is one and never required: whoever asks for a library must be able
to go on without it.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

from koopman_lab.files import cache_folder

COMPILERS = ("cc", "gcc", "clang")
# Contraction would make the last digits depend on the machine's instruction set.
FLAGS = ("-O3", "-ffp-contract=off", "-w", "-fPIC", "-shared")
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

    Raises
    ------
    NotCompiledError
        If there is no compiler, it fails, or the cache folder cannot be written.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NotCompiledError("no C compiler")
    kind = "\0".join((platform.system(), platform.machine(), compiler, *FLAGS, source))
    path = cache_folder() / f"{hashlib.sha256(kind.encode()).hexdigest()[:32]}.so"
    if not _loads(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _compile(compiler, source, path)
        except OSError as error:
            raise NotCompiledError(f"{path.parent}: {error.strerror or error}") from None
        if not _loads(path):
            raise NotCompiledError(f"what {compiler} makes cannot be loaded")
    return path


def _loads(path: Path) -> bool:
    """Return whether a library is there and sound; what is damaged is built again."""
    if not path.exists():
        return False
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
        # Whole or not at all, also when two processes build the same at once.
        built.replace(path)
