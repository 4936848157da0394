"""`klab goal`: send a robot that is being parked somewhere else."""

from __future__ import annotations

from typing import Annotated

import typer

from offboard.console import options
from offboard.console.terminal import err

TRIES = 100
WAIT_S = 0.02


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
    from koopman_lab.bus.channels import GOAL, MPC_STATE
    from koopman_lab.errors import LabStateError
    from offboard.controller.goal import goal_message, require_reachable

    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    wanted = options.pose_of(pose)
    require_reachable(wanted, lab.controller)
    listener = options.listen(lab)
    goals: list[tuple[float, ...]] = []
    listener.subscribe(MPC_STATE, lambda state: goals.append(tuple(state.goal)))
    for _ in range(TRIES):
        listener.publish(GOAL, goal_message(wanted, listener.now_us()))
        listener.spin(WAIT_S)
        if goals and goals[-1] == tuple(wanted):
            err.print("the controller drives there")
            return
    heard = "keeps another goal" if goals else "is silent; `klab park` starts a controller"
    raise LabStateError(f"{MPC_STATE.name(lab.robot.name)} {heard}")
