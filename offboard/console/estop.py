"""`klab estop`: stop the robot now."""

from __future__ import annotations

from typing import Annotated

import typer

from offboard.console import options
from offboard.console.terminal import err

TRIES = 100
WAIT_S = 0.02


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
    from koopman_lab.bus.channels import ESTOP, ONBOARD_STATUS
    from koopman_lab.errors import LabStateError

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    listener = options.listen(lab)
    states: list[int] = []
    listener.subscribe(ONBOARD_STATUS, lambda status: states.append(status.state))
    kind = lcmtypes.onboard_status_t
    for _ in range(TRIES):
        message = lcmtypes.estop_t()
        message.utime, message.engaged = listener.now_us(), not release
        listener.publish(ESTOP, message)
        listener.spin(WAIT_S)
        # A commander that waits for it may take a released robot at once.
        released = bool(states) and states[-1] not in (kind.ESTOP, kind.FAULT)
        if released if release else states[-1:] == [kind.ESTOP]:
            err.print("released" if release else "stopped; `klab estop --release` releases it")
            return
    heard = "does not confirm" if states else "is silent"
    raise LabStateError(
        f"{ONBOARD_STATUS.name(lab.robot.name)} {heard}: the message was sent {TRIES} times on "
        f"{lab.bus.url}; cut the power if the robot moves"
    )
