"""`klab estop`: stop the robot now, or all of them."""

from __future__ import annotations

from typing import Annotated

import typer

from offboard.terminal import options
from offboard.terminal.output import err


def estop(
    release: Annotated[
        bool, typer.Option("--release", help="Release the stop, and acknowledge a fault.")
    ] = False,
    all_robots: options.AllRobots = False,
    limit_s: Annotated[
        float | None,
        typer.Option(
            "--limit-s", min=0.02, help="Give up after this long; default: never, a release 2 s."
        ),
    ] = None,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """Stop the motors of a robot until they are released; sent until the robot says so.

    Where it does not within two seconds that is said, and the stop is sent on, since the robot may
    come back; Ctrl-C ends that. A release is given up then.

    With --all every robot that is heard on the bus is stopped, or released, all at the same time,
    and also that of the configuration as long as none is heard. Each is named once it says so; the
    exit code is 3, with their names, where some are given up.

    A stop is kept on the robot's board until it is released, also over a restart. The first message
    goes out before anything is loaded that is not needed for it.

    Example: klab estop
    """
    from offboard.commands.stop_robots import order_all, order_one

    options.refuse_one_and_all(robot_name, all_robots=all_robots)
    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    listener = options.listen(lab, None if release else err.print)
    order = order_all if all_robots else order_one
    order(listener, lab, release=release, say=err.print, limit_s=limit_s)
