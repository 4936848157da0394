"""Serves the page and, over a websocket, what it shows; takes what it asks for.

One thread does everything, outside the processes that drive the robot. A client that reads slowly
only misses snapshots: each is made for it when the one before has been taken.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
from collections.abc import AsyncIterator, Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection
from starlette.requests import Request as HttpRequest
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from koopman_lab.errors import LabError, LabStateError
from offboard.desk.orders import WAIT_S
from offboard.monitor.lab_view import Marks
from offboard.viewer.guard import Guard
from offboard.viewer.jobs import Jobs
from offboard.viewer.operator_desk import OperatorDesk
from offboard.viewer.protocols import HEADERS, LARGEST_HEAD
from offboard.viewer.refusals import Refusals
from offboard.viewer.request import (
    LARGEST_BYTES,
    OF_JOBS,
    START,
    STOP,
    Request,
    RequestError,
    parse_request,
)

PAGE = Path(__file__).parent / "page"
SNAPSHOT_S = 0.05
MOST_CLIENTS = 32
BAD_DATA, POLICY, TOO_MANY = 1003, 1008, 1013
"""Reasons for closing, as RFC 6455 and its registry number them."""
LARGEST_FRAME = LARGEST_BYTES * 4
"""Bytes; a longer frame closes the connection before it is read."""
BROKEN = {
    1002: "a frame that breaks the protocol",
    1007: "a frame that is no UTF-8",
    1009: f"a frame of more than {LARGEST_FRAME} bytes",
}
"""What the web server itself refuses, by the number it closes the connection with."""
BAD_REQUEST = 400
UNKNOWN = "unknown client"
LOOK_S = 5.0
"""So often it is looked what lies in the folder of runs, while somebody watches."""
WATCHES = "this address only watches; the operator's, which `klab view` printed as well, steers"
NO_JOBS = "this page starts nothing"
Log = Callable[[str], None]
PageMarks = tuple[Marks, int, bool]
"""What a page wants next of the histories, which version of the runs it has, if it may order."""


class _Limits:
    """Refuses requests with a body, which nothing here takes, and those with too long a head."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        app = self._app
        if scope["type"] == "http":
            headers = Headers(scope=scope)
            size = len(scope["raw_path"]) + len(scope["query_string"])
            size += sum(len(name) + len(value) for name, value in scope["headers"])
            if headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
                app = PlainTextResponse("no body is taken\n", 413, {"Connection": "close"})
            elif size > LARGEST_HEAD:
                app = PlainTextResponse("too long a request\n", 431, {"Connection": "close"})
        await app(scope, receive, send)


class Server:
    """The web application around a desk.

    Parameters
    ----------
    desk
        Hears and speaks.
    guard
        Says who is let in.
    log
        Takes lines about requests that were refused.
    jobs
        Starts things; None for a page that only shows and steers.
    """

    def __init__(
        self, desk: OperatorDesk, guard: Guard, log: Log, jobs: Jobs | None = None
    ) -> None:
        self._desk = desk
        self._jobs = jobs
        self._guard = guard
        self._refusals = Refusals(log)
        self._clients = 0
        self._repeating = False
        self._tick = asyncio.Event()
        self._snapshot_text = "{}"
        self._updates: dict[PageMarks, tuple[str, PageMarks]] = {}
        self._pending: set[asyncio.Task[None]] = set()
        routes = [
            Route("/", self._page),
            WebSocketRoute("/ws", self._socket),
            Mount("/static", StaticFiles(directory=PAGE)),
            WebSocketRoute("/{path:path}", self._nowhere),
        ]
        self.app = Starlette(
            routes=routes, middleware=[Middleware(_Limits)], lifespan=self._lifespan
        )

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        del app
        work = [asyncio.create_task(self._serve_snapshots())]
        if self._jobs is not None:
            work.append(asyncio.create_task(self._look_for_runs(self._jobs)))
        # Of what is no HTTP the web server tells nobody but its log.
        log = logging.getLogger("uvicorn.error")
        level = log.level
        log.setLevel(logging.INFO)
        log.addFilter(self._take_server_log)
        try:
            yield
        finally:
            log.removeFilter(self._take_server_log)
            log.setLevel(level)
            self._refusals.work(math.inf)
            for task in work:
                task.cancel()
            for task in work:
                with contextlib.suppress(asyncio.CancelledError):
                    await task
            if self._jobs is not None:
                await self._jobs.close()

    async def _serve_snapshots(self) -> None:
        """Again and again empty the bus, and let everybody have a snapshot of what it brought."""
        clock = asyncio.get_running_loop().time
        due_s = clock()
        while True:
            self._desk.repeat_orders()
            self._refusals.work(clock())
            now_us = self._desk.now_us()
            if self._jobs is not None:
                self._jobs.heard(self._desk.view.kinds_alive(now_us))
                self._jobs.step()
            if self._clients:
                robots = json.dumps(self._desk.view.snapshot(now_us), allow_nan=False)
                trust = json.dumps([self._desk.key_text, self._desk.view.refusals(now_us)])
                self._snapshot_text = f'"now_us":{now_us},"robots":{robots},"trust":{trust}'
                self._updates.clear()
            self._tick.set()
            self._tick = asyncio.Event()
            # Absolute, so that work does not add up; what is late is skipped, never caught up.
            due_s = max(due_s + SNAPSHOT_S, clock())
            await asyncio.sleep(due_s - clock())

    async def _look_for_runs(self, jobs: Jobs) -> None:
        while True:
            if self._clients:
                await jobs.look()
            await asyncio.sleep(LOOK_S)

    async def _repeat_orders(self) -> None:
        """Say orders again more often than there are snapshots, as long as one is not obeyed."""
        if self._repeating:
            return
        self._repeating = True
        try:
            while self._desk.ordering:
                await asyncio.sleep(WAIT_S)
                self._desk.repeat_orders()
        finally:
            self._repeating = False

    async def _page(self, request: HttpRequest) -> Response:
        objection = self._guard.objection(request.headers, request.query_params)
        if objection is not None:
            self._note_refusal(request, "page", objection)
            return PlainTextResponse(f"refused: {objection}\n", 403)
        return FileResponse(PAGE / "index.html")

    async def _nowhere(self, socket: WebSocket) -> None:
        await _deny(socket, 404, "no such websocket")

    async def _socket(self, socket: WebSocket) -> None:
        objection = self._guard.objection(socket.headers, socket.query_params)
        if objection is not None:
            self._note_refusal(socket, "socket", objection)
            await _deny(socket, 403, f"refused: {objection}")
            return
        await socket.accept()
        if self._clients == MOST_CLIENTS:
            self._note_refusal(
                socket, "client", f"{MOST_CLIENTS} pages are open, the most there may be"
            )
            await socket.close(TOO_MANY)
            return
        self._clients += 1
        feed = asyncio.create_task(self._feed(socket))
        try:
            await self._listen(socket)
        finally:
            self._clients -= 1
            self._desk.forget(socket)
            feed.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await feed

    async def _feed(self, socket: WebSocket) -> None:
        """Send the newest snapshot whenever the client has taken the one before."""
        marks: PageMarks = (), -1, self._guard.may_order(socket.query_params)
        while True:
            await self._tick.wait()
            update = self._updates.get(marks)
            if update is None:
                update = self._updates[marks] = self._update(marks)
            text, marks = update
            await socket.send_text(text)

    def _update(self, marks: PageMarks) -> tuple[str, PageMarks]:
        """Return what a page does not have yet, and what it wants next."""
        rows, version, may_order = marks
        news, following = self._desk.view.histories(rows)
        text = f'{self._snapshot_text},"news":{json.dumps(news, allow_nan=False)}'
        text += f',"may_order":{json.dumps(may_order)}'
        if self._jobs is not None and version != self._jobs.version:
            version = self._jobs.version
            text += f',"jobs":{json.dumps(self._jobs.as_json(), allow_nan=False)}'
        return f"{{{text}}}", (following, version, may_order)

    async def _listen(self, socket: WebSocket) -> None:
        """Take requests until the client goes, or sends what no page sends."""
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                if message.get("code") in BROKEN:
                    self._note_refusal(socket, "frame", BROKEN[message["code"]])
                return
            text = message.get("text")
            if text is None:
                self._note_refusal(socket, "frame", "a binary frame")
                await socket.close(BAD_DATA)
                return
            try:
                request = parse_request(text)
            except RequestError as error:
                self._note_refusal(socket, "request", str(error))
                await socket.close(POLICY)
                return
            reply = partial(self._reply, socket, request.robot)
            try:
                if not self._guard.may_order(socket.query_params):
                    raise LabStateError(WATCHES)
                if request.do in OF_JOBS:
                    reply(True, self._order_job(request))
                    continue
                if request.do == STOP and self._jobs is not None:
                    self._jobs.withdraw("STOP was pressed")
                self._desk.handle(request, socket, reply)
                self._run_beside(self._repeat_orders())
            except LabError as error:
                self._note_refusal(socket, "order", str(error))
                reply(False, str(error))

    def _order_job(self, request: Request) -> str:
        """Start something or end it; return what to say of it."""
        if self._jobs is None:
            raise LabStateError(NO_JOBS)
        if request.do == START:
            self._desk.require_fresh(request)
            return self._jobs.start(request.task, request.values)
        return self._jobs.remove(request.number)

    def _reply(self, socket: WebSocket, robot: str, good: bool, reply_text: str) -> None:
        async def send() -> None:
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await socket.send_text(
                    json.dumps({"robot": robot, "good": good, "said": reply_text})
                )

        self._run_beside(send())

    def _run_beside(self, work: Coroutine[Any, Any, None]) -> None:
        """Let it run beside everything else."""
        task = asyncio.get_running_loop().create_task(work)
        self._pending.add(task)
        task.add_done_callback(self._pending.discard)

    def note_refusal(self, client: str, kind: str, reason: str) -> None:
        """Take a refusal of a client (its address), one of a kind at a time to be said."""
        self._refusals.note(client, kind, reason, asyncio.get_running_loop().time())

    def _note_refusal(self, connection: HTTPConnection | None, kind: str, reason: str) -> None:
        client = None if connection is None else connection.client
        self.note_refusal(UNKNOWN if client is None else client.host, kind, reason)

    def _take_server_log(self, record: logging.LogRecord) -> bool:
        """Say as ours what the web server warns of; return whether it is to say it itself."""
        if record.exc_info and isinstance(record.exc_info[1], UnicodeDecodeError):
            return False  # its connection ends, with a number that tells
        bad_handshake = isinstance(record.args, tuple) and BAD_REQUEST in record.args
        if record.levelno == logging.WARNING or bad_handshake:
            self._note_refusal(None, "http", record.getMessage())
        return record.levelno > logging.WARNING


async def _deny(socket: WebSocket, status: int, reason: str) -> None:
    """Refuse a websocket with an answer like any other."""
    await socket.send_denial_response(PlainTextResponse(f"{reason}\n", status, headers=HEADERS))
