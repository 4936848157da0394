"""`klab estop`: stop the robot now."""

from __future__ import annotations

from collections import deque
from typing import Annotated

import typer

from offboard.terminal import options
from offboard.terminal.output import err


def estop(
    release: Annotated[
        bool, typer.Option("--release", help="Release the stop, and acknowledge a fault.")
    ] = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """Stop the motors of a robot until they are released; waits until the robot says so.

    Example: klab estop
    """
    import lcmtypes
    from koopman_lab.bus.channels import ONBOARD_STATUS
    from koopman_lab.errors import LabStateError
    from offboard.desk.orders import TRIES, WAIT_S, stop_order

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    listener = options.listen(lab)
    newest: deque[lcmtypes.onboard_status_t] = deque(maxlen=1)
    listener.subscribe(ONBOARD_STATUS, newest.append)
    order = stop_order(lambda: newest[0] if newest else None, release=release)
    while (obeyed := order.step(listener)) is None:
        listener.spin(WAIT_S)
    if obeyed:
        err.print("released" if release else "stopped; `klab estop --release` releases it")
        return
    answer = "does not confirm" if newest else "is silent"
    raise LabStateError(
        f"{ONBOARD_STATUS.name(lab.robot.name)} {answer}: the message was sent {TRIES} times on "
        f"{lab.bus.url}; cut the power if the robot moves"
    )
