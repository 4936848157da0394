"""`klab foxglove`: the lab live in Foxglove."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import LabStateError
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener, StopSignals

HOST, PORT = "127.0.0.1", 8767
"""Not 8765, which is usual for Foxglove: there is the page, and that of a replay next to it."""
LOOK_S = 0.1


@needs("foxglove")
def foxglove(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    url: options.Url = None,
    host: Annotated[
        str,
        typer.Option("--host", help="Where to listen; elsewhere than 127.0.0.1 anybody may watch."),
    ] = HOST,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="TCP port; 0 takes any.")
    ] = PORT,
) -> None:
    """Show every robot on the bus live in Foxglove, until Ctrl-C; nothing comes back from there.

    In Foxglove: open connection, Foxglove WebSocket, the address that is printed; in a 3D panel
    the display frame is `lab`.

    Example: klab foxglove --port 8767
    """
    from foxglove import Context, start_server

    from koopman_lab.bus.realtime import StopSignals
    from offboard.viewer.foxglove_feed import FoxgloveFeed

    lab = options.resolve(config, overrides, robot, url=url)
    listener = options.listen(lab)
    context = Context()
    feed = FoxgloveFeed(context)
    try:
        server = start_server(name="koopman-lab", host=host, port=port, context=context)
    except (OSError, RuntimeError, ValueError) as error:
        raise LabStateError(
            f"--host {host} --port {port}: cannot listen there ({error}); choose another --port"
        ) from None
    listener.overhear(feed.take)
    err.print(f"the lab on {lab.bus.url} is shown at ws://{_shown(host)}:{server.port}")
    stop = StopSignals()
    try:
        with stop.installed():
            while not stop.received:
                _spin(listener, stop)
    finally:
        server.stop()
    raise typer.Exit(ExitCode.INTERRUPTED)


def _spin(listener: Listener, stop: StopSignals) -> None:
    try:
        listener.spin(LOOK_S)
    except OSError:
        # LCM's wait ends this way when a signal handler ran in it.
        if not stop.received:
            raise


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
