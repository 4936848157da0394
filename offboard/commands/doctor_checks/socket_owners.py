"""Which process of this machine a datagram came from, looked up in /proc."""

from __future__ import annotations

import contextlib
import socket
from functools import cached_property
from pathlib import Path

from offboard.commands.doctor_checks.senders import Sender

TABLE = Path("/proc/net/udp")
"""See proc(5): in each line the local address as hexadecimal numbers, and the inode."""
ADDRESS, INODE = 1, 9
"""Columns."""
LONGEST = 60
"""Characters of a command line that are shown."""


class SocketOwners:
    """Names processes by the ports that they send from."""

    def text(self, sender: Sender) -> str:
        """Return in words which process of this machine it is; empty if it is none that is seen."""
        if not _is_here(sender.host):
            return ""
        pid = self._pids_by_inode.get(self._inodes_by_port.get(sender.port, ""))
        return "" if pid is None else f", process {pid}: {_command_line(pid)}"

    @cached_property
    def _inodes_by_port(self) -> dict[int, str]:
        inodes = {}
        with contextlib.suppress(OSError):
            for line in TABLE.read_text().splitlines()[1:]:
                fields = line.split()
                inodes[int(fields[ADDRESS].rpartition(":")[2], 16)] = fields[INODE]
        return inodes

    @cached_property
    def _pids_by_inode(self) -> dict[str, int]:
        """Look at the open sockets of all processes; only root sees those of other users."""
        pids = {}
        for folder in Path("/proc").glob("[0-9]*/fd"):
            with contextlib.suppress(OSError):
                for descriptor in folder.iterdir():
                    with contextlib.suppress(OSError):
                        kind, _, inode = str(descriptor.readlink()).partition(":[")
                        if kind == "socket":
                            pids[inode.rstrip("]")] = int(folder.parent.name)
        return pids


def _is_here(host: str) -> bool:
    """Return whether an address is one of this machine: only then can it be bound."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((host, 0))
        except OSError:
            return False
    return True


def _command_line(pid: int) -> str:
    """Return how a process was started, a `klab` command as a person typed it."""
    from offboard.lab.own_processes import klab_arguments

    arguments = klab_arguments(pid)
    if arguments is not None:
        words = ["klab", *arguments]
    else:
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            return "it has ended"
    text = " ".join(words).strip()
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
