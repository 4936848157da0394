"""`klab goal`: send a robot that is being parked somewhere else."""

from __future__ import annotations

from collections import deque
from typing import Annotated

import typer

from offboard.terminal import options
from offboard.terminal.output import err


def goal(
    pose: Annotated[
        tuple[float, float, float],
        typer.Argument(metavar="X1 X2 THETA", help="Goal pose in m, m, degrees."),
    ],
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """Change the goal of a robot that is being parked; waits until the controller says so.

    Example: klab goal 0.5 0.2 90
    """
    import lcmtypes
    from koopman_lab.bus.channels import MPC_STATE
    from koopman_lab.errors import LabStateError
    from offboard.desk.goal_message import goal_order
    from offboard.desk.orders import WAIT_S

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    newest: deque[lcmtypes.mpc_state_t] = deque(maxlen=1)
    order = goal_order(options.pose_from_typed(pose), lab, lambda: newest[0] if newest else None)
    listener = options.listen(lab)
    listener.subscribe(MPC_STATE, newest.append)
    while (obeyed := order.step(listener)) is None:
        listener.spin(WAIT_S)
    if obeyed:
        err.print("the controller drives there")
        return
    answer = "keeps another goal" if newest else "is silent; `klab park` starts a controller"
    raise LabStateError(f"{MPC_STATE.name(lab.robot.name)} {answer}")
