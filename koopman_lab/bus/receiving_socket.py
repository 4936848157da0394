"""The socket that the LCM library receives with, and the filter in front of it."""

from __future__ import annotations

import contextlib
import errno
import socket
import struct
import sys
from array import array
from collections.abc import Iterator
from pathlib import Path

from koopman_lab.bus.bus_url import MULTICAST
from koopman_lab.bus.datagram_filter import Program, packed

ATTACH_FILTER = 26
"""SO_ATTACH_FILTER of Linux, which Python does not name."""
PROCESS = Path("/proc/self")
SLEEPING, GONE = "S", ""
"""The first is one of the states of proc_pid_stat(5)."""


class FilterError(Exception):
    """No filter stands in front of a socket; says why."""


def open_descriptors() -> frozenset[int]:
    """Return the descriptors of this process; none where the system does not list them."""
    return _numbers("fd")


def running_threads() -> frozenset[int]:
    """Return the threads of this process; none where the system does not list them."""
    return _numbers("task")


def at_rest(descriptor: int, threads: frozenset[int]) -> bool:
    """Return whether nothing waits in a socket, and the threads that read it wait for it."""
    with _borrowed(descriptor) as udp:
        try:
            udp.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            # Asked after the socket: a thread that sleeps now has done with the last datagram.
            return all(_state(thread) in (SLEEPING, GONE) for thread in threads)
    return False


def receiving_socket(candidates: frozenset[int]) -> int | None:
    """Return which of these descriptors is a UDP socket bound to a multicast group.

    The library opens it when it is first asked to listen, and keeps it to itself.
    """
    for descriptor in sorted(candidates):
        with contextlib.suppress(OSError, ValueError), _borrowed(descriptor) as udp:
            if udp.family == socket.AF_INET and udp.type == socket.SOCK_DGRAM:
                host, _ = udp.getsockname()
                if socket.inet_aton(host)[0] in MULTICAST:
                    return descriptor
    return None


def is_held(port: int) -> bool:
    """Return whether a program holds a UDP port for itself, so that nobody else can listen."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind(("", port))
        except OSError as error:
            return error.errno == errno.EADDRINUSE
    return False


def attach(descriptor: int, program: Program) -> None:
    """Let the kernel drop what the program does not accept, instead of what it did before.

    What has arrived before stays in the socket.

    Raises
    ------
    FilterError
        If the kernel will not.
    """
    if sys.platform != "linux":
        raise FilterError(f"{sys.platform} has no SO_ATTACH_FILTER")
    instructions = array("B", packed(program))
    # struct sock_fprog: how many, and where.
    described = struct.pack("@HP", len(program), instructions.buffer_info()[0])
    try:
        with _borrowed(descriptor) as udp:
            udp.setsockopt(socket.SOL_SOCKET, ATTACH_FILTER, described)
    except OSError as error:
        raise FilterError(f"the kernel refuses SO_ATTACH_FILTER: {error.strerror}") from None


def _numbers(folder: str) -> frozenset[int]:
    with contextlib.suppress(OSError):
        return frozenset(int(entry.name) for entry in (PROCESS / folder).iterdir())
    return frozenset()


def _state(thread: int) -> str:
    """Return the letter by which the kernel says what a thread does."""
    try:
        stat = (PROCESS / "task" / str(thread) / "stat").read_text()
    except OSError:
        return GONE
    return stat.rpartition(")")[2].split()[0]


@contextlib.contextmanager
def _borrowed(descriptor: int) -> Iterator[socket.socket]:
    """Give a socket of another owner, who keeps it."""
    borrowed = socket.socket(fileno=descriptor)
    try:
        yield borrowed
    finally:
        borrowed.detach()
