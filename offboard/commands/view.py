"""`klab view`: one page that shows the lab and steers it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import socket
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

HOST, PORT = "127.0.0.1", 8765
EVERYWHERE = ("0.0.0.0", "::")
SIOCGIFADDR, ADDRESS = 0x8915, slice(20, 24)
"""The question for an interface's address, and where it stands in the answer: netdevice(7)."""
BACKLOG = 48
"""Connections that are accepted at a time: three times as many, which may be there before the first
of them is read, are fewer than one client may have."""
PING_S = 20.0
"""A client that answers no ping for so long is gone."""

Host = Annotated[
    str,
    typer.Option(
        "--host", help="Where to listen; other than 127.0.0.1 the address then holds a token."
    ),
]
Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="TCP port; 0 takes any.")]


TOKEN = "KOOPMAN_LAB_PAGE_TOKEN"
"""Environment variable by which `klab up` gives the token: a list of processes would show it."""


@needs("desk")
def view(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    url: options.Url = None,
    host: Host = HOST,
    port: Port = PORT,
) -> None:
    """Serve a page that shows every robot on the bus and runs the lab, until Ctrl-C.

    It stops robots, lets them go and sends them to goals, and starts calibrate, train, park,
    reference and replay, one after the other, with --config and --set of this command. What
    it starts leaves its run folders in runs/ of this folder, and ends with the page.

    With --host other machines reach it: by one address to operate the lab, by another to watch.

    Example: klab view --port 8765
    """
    lab = options.resolve(config, overrides, robot, url=url)
    for_jobs = [*(["--config", str(config.absolute())] if config else [])]
    for override in overrides or ():
        for_jobs += ["--set", override]
    serve(lab, listen(host, port), token_for(host), for_jobs, as_configured=config is not None)
    raise typer.Exit(ExitCode.INTERRUPTED)


def serve(
    config: LabConfig,
    listening: socket.socket,
    token: str | None,
    for_jobs: Sequence[str] = (),
    lifeline_fd: int | None = None,
    *,
    as_configured: bool = False,
    robot_known: bool = False,
) -> None:
    """Serve the page until SIGINT, SIGTERM, or the end of the lifeline.

    Parameters
    ----------
    config
        Names the bus.
    listening
        From :func:`listen`.
    token
        From :func:`token_for`.
    for_jobs, as_configured
        Options and ``as_configured`` of :class:`~offboard.lab.job_runner.JobRunner`.
    lifeline_fd
        As for :func:`~koopman_lab.bus.realtime.run_node`.
    robot_known
        As for :class:`~offboard.viewer.operator_desk.OperatorDesk`.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    """
    import asyncio

    import uvicorn

    from offboard.lab.job_runner import JobRunner
    from offboard.viewer.guard import Guard
    from offboard.viewer.operator_desk import OperatorDesk
    from offboard.viewer.protocols import HEADERS, LARGEST_HEAD, LimitedSocket, limited
    from offboard.viewer.server import LARGEST_FRAME, Server

    desk = OperatorDesk(config, robot_known=robot_known)
    jobs = JobRunner(config, for_jobs, as_configured=as_configured, secrets=[TOKEN])

    async def run() -> None:
        server = Server(desk, Guard(token), lambda line: err.print(line), jobs)
        settings = uvicorn.Config(
            server.app,
            http=limited(server.note_refusal),
            ws=LimitedSocket,
            h11_max_incomplete_event_size=LARGEST_HEAD,
            backlog=BACKLOG,
            headers=list(HEADERS.items()),
            server_header=False,
            proxy_headers=False,  # by which a client would say that it is another
            ws_max_size=LARGEST_FRAME,
            ws_per_message_deflate=False,  # costs more than 5 kB on a local network
            ws_ping_interval=PING_S,
            ws_ping_timeout=PING_S,
            log_level="error",
            access_log=False,
            timeout_graceful_shutdown=1,
        )
        http = uvicorn.Server(settings)
        if lifeline_fd is not None:
            loop = asyncio.get_running_loop()
            loop.add_reader(lifeline_fd, lambda: setattr(http, "should_exit", True))
        shown = " or ".join(addresses(listening, token))
        err.print(f"the lab on {config.bus.url} is shown at {shown}")
        show_watching(listening, token)
        await http.serve([listening])

    # uvicorn ends cleanly on a signal, then raises it once more.
    try:
        asyncio.run(run())
    except KeyboardInterrupt:
        raise typer.Exit(ExitCode.INTERRUPTED) from None


def free_port() -> int:
    """Return a TCP port of this machine that nobody uses now."""
    with listen(HOST, 0) as free:
        port: int = free.getsockname()[1]
        return port


def token_for(host: str) -> str | None:
    """Return what the address must hold; None where only this machine can reach the page."""
    from offboard.viewer.guard import LOOPBACK

    return None if host in LOOPBACK else os.environ.get(TOKEN) or secrets.token_urlsafe(16)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises
    ------
    LabStateError
        If the port cannot be had.
    """
    from koopman_lab.errors import LabStateError

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise LabStateError(
            f"--host {host} --port {port}: cannot listen there ({error.strerror}); another "
            "`klab view` may run: open its page, or choose another --port"
        ) from None
    return listening


def addresses(listening: socket.socket, token: str | None) -> list[str]:
    """Return what to open in a browser: by name and, from other machines, by number as well."""
    host, port = listening.getsockname()[:2]
    hosts = [socket.gethostname(), *_own_addresses()] if host in EVERYWHERE else [host]
    query = "" if token is None else f"?token={token}"
    return [f"http://{f'[{h}]' if ':' in h else h}:{port}/{query}" for h in hosts]


def show_watching(listening: socket.socket, token: str | None) -> None:
    """Print the addresses of who is only to watch, where others can reach the page."""
    from offboard.viewer.guard import watching_token

    if token is not None:
        shown = " or ".join(addresses(listening, watching_token(token)))
        err.print(f"to watch only: {shown}")


def _own_addresses() -> list[str]:
    """Return this machine's IPv4 addresses that others may reach; few phones know its name."""
    ipv4_addresses = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode())
            with contextlib.suppress(OSError):  # an interface without an address
                reply = fcntl.ioctl(any_socket, SIOCGIFADDR, request)
                ipv4_addresses.append(socket.inet_ntoa(reply[ADDRESS]))
    return [address for address in ipv4_addresses if not address.startswith("127.")]
