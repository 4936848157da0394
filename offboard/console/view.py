"""`klab view`: one page that shows the lab and steers it."""

from __future__ import annotations

import secrets
import socket
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.console import options
from offboard.console.terminal import err

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

HOST, PORT = "127.0.0.1", 8765
EVERYWHERE = ("0.0.0.0", "::")
PING_S = 20.0
"""A client that answers no ping for so long is gone."""
INTERRUPTED = 130

Host = Annotated[
    str,
    typer.Option(
        "--host", help="Where to listen; other than 127.0.0.1 the address then holds a token."
    ),
]
Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="TCP port; 0 takes any.")]


def view(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    url: options.Url = None,
    host: Host = HOST,
    port: Port = PORT,
) -> None:
    """Serve a page that shows every robot on the bus, sets goals and stops them, until Ctrl-C.

    Example: klab view --port 8765
    """
    lab = options.resolve(config, overrides, options.kind_of(robot), url=url)
    serve(lab, host, port)
    raise typer.Exit(INTERRUPTED)


def serve(config: LabConfig, host: str, port: int, lifeline_fd: int | None = None) -> None:
    """Serve the page until SIGINT, SIGTERM, or the end of the lifeline.

    Raises
    ------
    LabStateError
        If the extra packages are missing or the port cannot be had.
    BusError
        If the bus cannot be opened.
    """
    from koopman_lab.errors import LabStateError

    try:
        import uvicorn
        import websockets  # noqa: F401  uvicorn asks for it only when the first page connects

        from offboard.viewer.server import LARGEST_FRAME, Server
    except ModuleNotFoundError as missing:
        raise LabStateError(
            f"klab view needs {missing.name}; install it: pip install 'koopman-lab[view]'"
        ) from None
    import asyncio

    from offboard.viewer.desk import Desk
    from offboard.viewer.guard import LOOPBACK, Guard

    token = None if host in LOOPBACK else secrets.token_urlsafe(16)
    listening = _listen(host, port)
    desk = Desk(config)
    address = f"http://{_shown(host)}:{listening.getsockname()[1]}/"
    if token is not None:
        address += f"?token={token}"

    async def run() -> None:
        server = Server(desk, Guard(token), lambda line: err.print(line, markup=False))
        settings = uvicorn.Config(
            server.app,
            ws="websockets-sansio",
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
        err.print(f"the lab on {config.bus.url} is shown at {address}", markup=False)
        await http.serve([listening])

    # uvicorn ends cleanly on a signal, then raises it once more.
    try:
        asyncio.run(run())
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None


def free_port() -> int:
    """Return a TCP port of this machine that nobody uses now."""
    with socket.socket() as free:
        free.bind((HOST, 0))
        port: int = free.getsockname()[1]
        return port


def _shown(host: str) -> str:
    """Return how a browser is to name the host."""
    if host in EVERYWHERE:
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host


def _listen(host: str, port: int) -> socket.socket:
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
