"""LCM that hears nothing but what its library can take: a filter stands before it listens."""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping

import lcm

from koopman_lab.bus import receiving_socket
from koopman_lab.bus.bus_url import parse_bus_url, route_remedy
from koopman_lab.bus.datagram_filter import SHUT, datagram_filter
from koopman_lab.bus.receiving_socket import FilterError
from koopman_lab.errors import BusError

Handler = Callable[[str, bytes], None]
"""Called with the name of a channel and the bytes of a message."""

REST_S = 0.0005
MOST_RESTS = 4000
"""Looks at the reading thread; it takes some microseconds for each datagram that waits."""
ANY_CHANNEL = ".*"
QUEUE_CAPACITY = 50_000
"""Messages that wait for a handler, of each subscription: at 240 Hz those of three minutes.

Nobody who works lets so many wait, and without a bound a flood fills the memory of who does not.
"""


class FilteredBus(lcm.LCM):
    """LCM whose socket passes only messages to the channels that are subscribed to.

    The library opens its receiving socket at the first need and reads it in a thread of its own,
    so what comes before the filter stands is read without it. That is harmless as long as nobody
    subscribes: the fault is in handing a message on. So the socket is shut, what it holds is
    waited for and handed to nobody, and only then does it open again, filtered.

    Attributes
    ----------
    filter_fault
        Why no filter stands; empty where one does.
    """

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self.filter_fault = f"{url}: nobody listens yet"
        self._url = url
        self._socket: int | None = None
        self._listens = self._is_deaf = False
        self._names: set[str] = set()
        self._takes_any = False

    def fileno(self) -> int:
        """Return what becomes readable when a message has arrived; begin to listen.

        Raises
        ------
        BusError
            If the library cannot listen.
        """
        self._begin_to_listen()
        return super().fileno()

    def subscribe(self, channel: str, callback: Handler) -> lcm.LCMSubscription:
        """Subscribe to a regular expression of channels, and let those of any name pass.

        Raises
        ------
        BusError
            If the library cannot listen.
        """
        self._begin_to_listen()
        self._takes_any = True
        self._attach()
        return super().subscribe(channel, callback)

    def subscribe_exactly(self, handlers: Mapping[str, Handler]) -> None:
        """Subscribe to the channels of these names, with queues of :data:`QUEUE_CAPACITY`.

        LCM takes regular expressions, and by default keeps only the oldest 30 messages.

        Raises
        ------
        BusError
            If the library cannot listen.
        """
        self._begin_to_listen()
        self._names.update(handlers)
        self._attach()
        for name, handler in handlers.items():
            super().subscribe(f"^{re.escape(name)}$", handler).set_queue_capacity(QUEUE_CAPACITY)

    def subscribe_to_all(self, handler: Handler) -> None:
        """Subscribe to every channel, with a queue of :data:`QUEUE_CAPACITY`.

        Raises
        ------
        BusError
            If the library cannot listen.
        """
        self.subscribe(ANY_CHANNEL, handler).set_queue_capacity(QUEUE_CAPACITY)

    def _begin_to_listen(self) -> None:
        if not self._listens:
            self._open_receiving_socket()
        if self._is_deaf:
            raise BusError(
                f"bus.url {self._url}: LCM can send there, but not listen: {self._why()}"
            )

    def _why(self) -> str:
        """Return why LCM cannot listen, and what to do."""
        port = parse_bus_url(self._url).port
        if receiving_socket.is_held(port):
            return (
                f"a program that does not share it holds port {port}; end it (`ss -ulpn "
                f"'sport = :{port}'` names it), or take another port, for example {port + 1}"
            )
        return (
            "what it sends to itself does not come back. Either a firewall drops UDP on port "
            f"{port}: let it pass; or the route for multicast leads elsewhere: "
            f"{route_remedy(self._url)}"
        )

    def _open_receiving_socket(self) -> None:
        self._listens = True
        descriptors = receiving_socket.open_descriptors()
        threads = receiving_socket.running_threads()
        with without_stderr():
            # It says so only once: who asks again is told that all is well.
            self._is_deaf = super().fileno() < 0
        self._socket = receiving_socket.receiving_socket(
            receiving_socket.open_descriptors() - descriptors
        )
        reading = receiving_socket.running_threads() - threads
        self.filter_fault = self._shut(reading)
        self._attach()

    def _shut(self, reading: frozenset[int]) -> str:
        """Let nothing more in, and wait until nothing is left; return why that cannot be done."""
        if not self._url.startswith("udpm://"):
            return f"{self._url}: only sockets of udpm:// are filtered"
        if self._socket is None:
            return f"{self._url}: no socket of LCM's is found among the descriptors"
        try:
            receiving_socket.attach(self._socket, SHUT)
        except FilterError as error:
            return str(error)
        for _ in range(MOST_RESTS):
            if receiving_socket.at_rest(self._socket, reading):
                break
            time.sleep(REST_S)
        while self.handle_timeout(0) > 0:
            pass
        return ""

    def _attach(self) -> None:
        """Pass what is subscribed to by now."""
        if self.filter_fault or self._socket is None:
            return
        if not self._takes_any:
            # Old kernels grant a socket 20 kB for its filters: too little for many names.
            with contextlib.suppress(FilterError):
                receiving_socket.attach(self._socket, datagram_filter(self._names))
                return
        try:
            receiving_socket.attach(self._socket, datagram_filter())
        except FilterError as error:
            self.filter_fault = str(error)


@contextlib.contextmanager
def without_stderr() -> Iterator[None]:
    """Keep LCM's C library from writing a page of its own to standard error."""
    saved, devnull = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(devnull)
