"""`klab up`: the lab's standing processes until Ctrl-C."""

from __future__ import annotations

import contextlib
import os
import socket
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.bus.processes import PROCESSES
from koopman_lab.robots.table import robot_type
from offboard.commands.view import (
    HOST,
    PORT,
    TOKEN,
    Host,
    Port,
    addresses,
    listen,
    show_watching,
    token_for,
)
from offboard.lab.run_folder import new_folder
from offboard.terminal import options
from offboard.terminal.choices import name_option
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.needs import needs
from offboard.terminal.output import err, status_line

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from offboard.lab.supervisor import Supervisor

PAGE_LIMIT_S = 30.0
"""As long as other processes may take to start."""
WAIT_S = 0.1


@needs("desk", "--view", lambda options: options["view"])
def up(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    preset: options.Preset = options.PresetName.lab,
    seed: options.Seed = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
    out: options.Out = None,
    view: Annotated[
        bool, typer.Option("--view", help="Serve the page of `klab view` too.")
    ] = False,
    host: Host = HOST,
    port: Port = PORT,
    added_nodes: Annotated[
        list[str] | None,
        name_option(
            *("--with", "added node", PROCESSES.plugin_names),
            "One that another package adds, as one of the lab; several may be named.",
        ),
    ] = None,
) -> None:
    """Run plant, onboard loop and logger as supervised processes until Ctrl-C or `klab down`.

    If one dies, the robot stops, the others are ended, and its last lines are shown: nothing is
    started again behind your back. A page (--view) stays until Ctrl-C and says who died. Each
    process is asked to end by SIGINT, after 3 s by SIGTERM, after 3 s more by SIGKILL. Nodes of
    other packages (--with) run in the same way and on the same configuration; one that commands
    the robot may end by itself.

    Example: klab up --robot dynamic --robot-name R2
    """
    from koopman_lab.bus.processes import STANDING, Stop, stopping
    from koopman_lab.errors import LabStateError, UsageError
    from offboard.lab.lab_lock import lab_lock
    from offboard.lab.present_nodes import present_nodes
    from offboard.lab.supervisor import start_missing, supervised

    lab_config = options.resolve(config, overrides, robot, preset, seed, url, robot_name=robot_name)
    robot_type(lab_config.robot.kind).on_two_wheels()
    lab_config.require_simulation()
    # Before anything is started: a package that does not fit is one message.
    for name in added_nodes or ():
        missing = set(PROCESSES.get(name).needs) - {*STANDING, *(added_nodes or ())}
        if missing:
            raise UsageError(
                f"--with {name}: needs {', '.join(sorted(missing))}, which the lab does not run"
            )
    try:
        with contextlib.ExitStack() as stack:
            lock = stack.enter_context(contextlib.ExitStack())
            lock.enter_context(lab_lock(lab_config))
            page = stack.enter_context(listen(host, port)) if view else None
            listener = options.listen(lab_config)
            present = present_nodes(listener) & stopping(Stop.BOARD, Stop.HARDWARE)
            if present:
                raise LabStateError(
                    f"{', '.join(sorted(present))} of {lab_config.robot.name} already on "
                    f"{lab_config.bus.url}; stop that lab, or take another name with "
                    "--robot-name R2"
                )
            folder = new_folder(out, "up", lab_config)
            lab = stack.enter_context(supervised(lab_config, folder, listener))
            start_missing(lab, set(), folder)
            for name in added_nodes or ():
                lab.start(name)
            lab.wait_ready(*(added_nodes or ()))
            if page is not None:
                _start_page(listener, lab, page, host)
            name, kind = lab_config.robot.name, lab_config.robot.kind
            err.print(f"{name} ({kind}) is up on {lab_config.bus.url}; log: {folder.log}")
            same = "" if robot_name is None else f" with --robot-name {name}"
            err.print(
                f"Ctrl-C ends it; `klab calibrate` and `klab park`{same} in another terminal use it"
            )
            try:
                with status_line() as show:
                    _show_until_interrupted(listener, lab, show)
            except LabStateError as death:
                if page is None:
                    raise
                err.print(f"klab: {death}")
                lab.stop_lab()
                lock.close()
                _keep_page(listener, lab)
    except KeyboardInterrupt:
        err.print("stopped")
        raise typer.Exit(ExitCode.INTERRUPTED) from None


def _start_page(listener: Listener, lab: Supervisor, page: socket.socket, host: str) -> None:
    """Start the page and name its addresses once it answers: nobody follows them into nothing.

    Nobody else can answer on the socket, which listens since before anything was started.
    """
    from koopman_lab.errors import LabStateError

    token = token_for(host)
    if token is not None:
        os.environ[TOKEN] = token
    fd = page.fileno()
    lab.start("view", "--host", host, "--socket-fd", str(fd), pass_fds=[fd])
    address = page.getsockname()[:2]
    with socket.create_connection(address) as client:
        client.sendall(b"HEAD /static/app.js HTTP/1.0\r\n\r\n")
        client.settimeout(WAIT_S)
        for _ in range(round(PAGE_LIMIT_S / WAIT_S)):
            with contextlib.suppress(TimeoutError):
                client.recv(1)
                break
            listener.spin(0.0)
            lab.check()
        else:
            raise LabStateError(f"view: no answer on port {address[1]} within {PAGE_LIMIT_S:g} s")
    err.print(f"page: {' or '.join(addresses(page, token))}")
    show_watching(page, token)


def _keep_page(listener: Listener, lab: Supervisor) -> None:
    """Let the page be until it is interrupted: it says who died, and may start the robot anew."""
    err.print("the page stays until Ctrl-C; it can start the robot anew")
    try:
        while True:
            listener.spin(WAIT_S)
            lab.check()
    except KeyboardInterrupt:
        raise typer.Exit(ExitCode.LAB_FAILURE) from None


def _show_until_interrupted(
    listener: Listener, lab: Supervisor, show: Callable[[str], None]
) -> None:
    """Show how the lab is until it is interrupted or a process dies."""
    import lcmtypes
    from koopman_lab.bus.channels import LOGGER_STATUS, ONBOARD_STATUS
    from offboard.monitor.headline import motor_loop_text

    onboard: deque[lcmtypes.onboard_status_t] = deque(maxlen=1)
    logger: deque[lcmtypes.logger_status_t] = deque(maxlen=1)
    listener.subscribe(ONBOARD_STATUS, onboard.append)
    listener.subscribe(LOGGER_STATUS, logger.append)
    while True:
        listener.spin(0.2)
        lab.check()
        if onboard and logger:
            robot, log = onboard[0], logger[0]
            show(
                f"{motor_loop_text(robot)}, {robot.battery_v:.1f} V; {log.events} messages stored, "
                f"{log.mocap_lost_messages} camera messages lost"
            )
