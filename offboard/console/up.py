"""`klab up`: the lab's standing processes until Ctrl-C."""

from __future__ import annotations

import contextlib
import socket
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from offboard.console import options
from offboard.console.folder import new_folder
from offboard.console.terminal import err, status_line
from offboard.console.view import HOST, PORT, Port, free_port

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from offboard.console.supervisor import Supervisor

PAGE_LIMIT_S = 30.0
"""As long as other processes may take to start."""
WAIT_S = 0.1


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
    port: Port = PORT,
) -> None:
    """Run plant, onboard loop and logger as supervised processes until Ctrl-C or `klab down`.

    If one dies, the robot stops, the others are ended, and its last lines are shown: nothing is
    started again behind your back. Each process is asked to end by SIGINT, after 3 s by SIGTERM,
    after 3 s more by SIGKILL.

    Example: klab up --robot dynamic --robot-name R2
    """
    from koopman_lab.errors import LabStateError
    from offboard.console.claim import claimed
    from offboard.console.supervisor import present, start_missing, supervised

    lab_config = options.resolve(
        config, overrides, options.kind_of(robot), preset, seed, url, robot_name=robot_name
    )
    try:
        with contextlib.ExitStack() as stack:
            stack.enter_context(claimed(lab_config))
            listener = options.listen(lab_config)
            there = present(listener) & {"plant", "onboard"}
            if there:
                raise LabStateError(
                    f"{', '.join(sorted(there))} of {lab_config.robot.name} already on "
                    f"{lab_config.bus.url}; stop that lab, or take another name with "
                    "--robot-name R2"
                )
            folder = new_folder(out, "up", lab_config)
            lab = stack.enter_context(supervised(lab_config, folder, listener))
            start_missing(lab, set(), folder)
            if view:
                port = port or free_port()
                lab.start("view", "--port", str(port))
                _wait_served(listener, lab, port)
                err.print(f"page: http://{HOST}:{port}/")
            name, kind = lab_config.robot.name, lab_config.robot.kind
            err.print(f"{name} ({kind}) is up on {lab_config.bus.url}; log: {folder.log}")
            same = "" if robot_name is None else f" with --robot-name {name}"
            err.print(
                f"Ctrl-C ends it; `klab calibrate` and `klab park`{same} in another terminal use it"
            )
            with status_line() as show:
                _follow(listener, lab, show)
    except KeyboardInterrupt:
        err.print("stopped")
        raise typer.Exit(130) from None


def _wait_served(listener: Listener, lab: Supervisor, port: int) -> None:
    """Wait until the page can be opened, so that nobody follows its address into nothing."""
    from koopman_lab.errors import LabStateError

    for _ in range(round(PAGE_LIMIT_S / WAIT_S)):
        with contextlib.suppress(OSError), socket.create_connection((HOST, port), WAIT_S):
            return
        listener.spin(WAIT_S)
        lab.check()
    raise LabStateError(f"view: not served on port {port} within {PAGE_LIMIT_S:g} s")


def _follow(listener: Listener, lab: Supervisor, show: Callable[[str], None]) -> None:
    """Show how the lab is until it is interrupted or a process dies."""
    import lcmtypes
    from koopman_lab.bus.channels import LOGGER_STATUS, ONBOARD_STATUS
    from offboard.viewer.words import standing

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
                f"{standing(robot)}, {robot.battery_v:.1f} V; {log.events} messages stored, "
                f"{log.mocap_lost_messages} camera messages lost"
            )
