"""The web server's two protocols, held to limits: of connections, of time, and of what is sent.

uvicorn waits for ever for a request that does not come, for a client that does not read, and passes
on to the websocket library what that cannot read. Here every connection has a time limit, the
oldest without a request go where there are too many, and every answer carries the same headers.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import h11
from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.http11 import Request
from websockets.server import ServerProtocol

from offboard.viewer.connections import PATIENCE_S, Connections

LARGEST_HEAD = 8192
"""Bytes of request line and headers together; a browser sends less than 1000."""
LINGER_S = 2.0
"""So long a connection that is being closed may take to take what was sent."""
MOST_SOCKETS = 64
"""Websockets, with those that are being closed because there are too many."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
        "object-src 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Of every answer: nobody else's page may hold or read this one, and it sends its address, which
may hold the token, to nobody. A browser asks again each time, since scripts belong to a version."""

NoteRefusal = Callable[[str, str, str], None]
"""Takes client, kind and reason."""


class LimitedSocket(WebSocketsSansIOProtocol):
    """A websocket whose client is put out where it does not read."""

    async def send(self, message: ASGISendEvent) -> None:
        """Send, and say that an answer that refuses the websocket is complete."""
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and self.close_sent:
            self.handshake_complete = True

    def keepalive_timeout(self) -> None:
        """Close a connection whose client answers no ping, also where it takes nothing."""
        super().keepalive_timeout()
        self.loop.call_later(LINGER_S, self.transport.abort)

    def on_task_complete(self, task: asyncio.Task[None]) -> None:
        """See that the connection ends with what serves it."""
        super().on_task_complete(task)
        self.loop.call_later(self.close_timeout + LINGER_S, self.transport.abort)


class LimitedHttp(H11Protocol):
    """HTTP with an end to every wait; :func:`limited` makes the one of a server."""

    limits: Connections[LimitedHttp]
    note_refusal: NoteRefusal

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; another connection may have to go."""
        assert isinstance(transport, asyncio.Transport)
        super().connection_made(transport)
        self._no_more_comes = False
        self._deadline = self.loop.call_later(PATIENCE_S, self._out_of_time)
        surplus = self.limits.add(self, self._client_name)
        if surplus is not None:
            surplus.drop("too many connections")

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._forget()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take bytes, until the connection is being closed."""
        if self.transport.is_closing():
            return
        super().data_received(data)
        if self._answering:
            self.limits.asked(self)

    def eof_received(self) -> bool:  # type: ignore[override]  # as asyncio has it
        """Answer first what was asked by a client that has nothing more to say."""
        self._no_more_comes = True
        return self._answering

    def on_response_complete(self) -> None:
        """Give the next request as much time as the first."""
        self._deadline.cancel()
        self._deadline = self.loop.call_later(PATIENCE_S, self._out_of_time)
        self.limits.answered(self)
        super().on_response_complete()
        if self._no_more_comes and not self._answering:
            self.transport.close()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection over to the websocket if its library can read the request."""
        sockets = sum(isinstance(other, LimitedSocket) for other in self.connections)
        if sockets >= MOST_SOCKETS:
            self.drop("too many websockets")
        elif not self._can_upgrade(event):
            self.note_refusal(self._client_name, "http", "a bad request for a websocket")
            self.send_400_response("This is no request for a websocket.")
        else:
            self._forget()
            super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP, where an answer can still be given."""
        if self._answering or self.conn.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            if self.cycle is not None:
                self.cycle.disconnected = True  # what answers is not to go on
            self.transport.abort()
            return
        # Written out, since to a request that is none h11 answers only in some states.
        headers = {"Content-Length": str(len(msg)), "Connection": "close", **HEADERS}
        head = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        answer = f"HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\n{head}\r\n{msg}"
        self.transport.write(answer.encode("ascii"))
        self.transport.close()
        self.loop.call_later(LINGER_S, self.transport.abort)

    def drop(self, reason: str) -> None:
        """End the connection at once."""
        self.note_refusal(self._client_name, "connection", reason)
        self._forget()
        self.transport.abort()

    @property
    def _answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    @property
    def _client_name(self) -> str:
        return self.client[0] if self.client else "unknown client"

    def _out_of_time(self) -> None:
        self.drop(f"no request within {PATIENCE_S:g} s, or its answer was not taken")

    def _forget(self) -> None:
        self._deadline.cancel()
        self.limits.remove(self)

    def _can_upgrade(self, event: h11.Request) -> bool:
        """Ask the library, which would end in an error of its own later."""
        lines = [b"%b %b HTTP/1.1" % (event.method, event.target)]
        lines += [b"%b: %b" % (name, value) for name, value in self.headers]
        probe = ServerProtocol(logger=self.logger)
        probe.receive_data(b"\r\n".join([*lines, b"", b""]))
        requests = probe.events_received()
        if probe.parser_exc is not None or not requests or not isinstance(requests[0], Request):
            return False
        return probe.accept(requests[0]).status_code == 101


def limited(note_refusal: NoteRefusal) -> type[LimitedHttp]:
    """Return the protocol of one server, whose connections count together."""

    class OfOneServer(LimitedHttp):
        limits: Connections[LimitedHttp] = Connections()

        def note_refusal(self, *refusal: Any) -> None:
            note_refusal(*refusal)

    return OfOneServer
