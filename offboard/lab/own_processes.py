"""Which processes of this machine are commands of ours, looked up in /proc.

A process number that somebody says on the bus may be anybody's: whoever ends processes by such
numbers asks the machine itself who they are.
"""

from __future__ import annotations

import os
from pathlib import Path

MODULE, SCRIPT = "offboard.cli.main", "klab"
GUARDED_MODULE = "offboard.cli.end_with_parent"
"""Runs the same for as long as who started it lives; its first argument is none of `klab`."""
OPTIONS_WITH_VALUE = ("-W", "-X")
"""Of Python; the value stands apart."""


def klab_arguments(pid: int) -> list[str] | None:
    """Return the arguments of a `klab` command of this user; None where a process is none.

    It is Python that runs the module or the script; a name in the arguments of another program, as
    an editor's of a file, makes none.
    """
    process = Path(f"/proc/{pid}")
    try:
        is_own = process.stat().st_uid == os.geteuid()
        words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")[:-1]
    except OSError:
        return None
    if not is_own or not words or not Path(words[0]).name.startswith("python"):
        return None
    rest = words[1:]
    while rest and rest[0].startswith("-") and rest[0] not in ("-m", "-c", "-"):
        rest = rest[2:] if rest[0] in OPTIONS_WITH_VALUE else rest[1:]
    if rest[:2] == ["-m", MODULE]:
        return rest[2:]
    if rest[:2] == ["-m", GUARDED_MODULE]:
        return rest[3:]
    if rest and (Path(rest[0]).name == SCRIPT or rest[0].endswith("offboard/cli/main.py")):
        return rest[1:]
    return None


def is_klab(pid: int) -> bool:
    """Return whether a process is a `klab` command of this user; numbers are used again."""
    return klab_arguments(pid) is not None


def is_started_by(pid: int, name: str, supervisor_pid: int) -> bool:
    """Return whether a process runs the node ``name``, and a `klab` command is its parent."""
    arguments = klab_arguments(pid)
    return (
        arguments is not None
        and arguments[:2] == ["run", name]
        and _parent(pid) == supervisor_pid
        and is_klab(supervisor_pid)
    )


def alive(pid: int) -> bool:
    """Return whether a process exists and is no zombie."""
    fields = _stat_fields(pid)
    return fields is not None and fields[0] != "Z"


def _parent(pid: int) -> int | None:
    fields = _stat_fields(pid)
    return None if fields is None else int(fields[1])


def _stat_fields(pid: int) -> list[str] | None:
    """Return what proc_pid_stat(5) says behind the name, which may hold anything."""
    try:
        line = Path(f"/proc/{pid}/stat").read_text(errors="replace")
    except OSError:
        return None
    return line.rpartition(")")[2].split()
