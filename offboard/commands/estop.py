"""`klab estop`: stop the robot now, or all of them."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.output import err
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.desk.orders import Order, Sender
    from offboard.monitor.robots_heard import RobotsHeard


def estop(
    release: Annotated[
        bool, typer.Option("--release", help="Release the stop, and acknowledge a fault.")
    ] = False,
    all_robots: options.AllRobots = False,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot_name: options.RobotsName = None,
    url: options.Url = None,
) -> None:
    """Stop the motors of a robot until they are released; waits until the robot says so.

    With --all every robot that is heard on the bus is stopped, or released, all at the same time,
    and also that of the configuration as long as none is heard. Each is named once it says so; the
    exit code is 2, with their names, where some do not.

    Example: klab estop
    """
    options.refuse_one_and_all(robot_name, all_robots=all_robots)
    lab = options.resolve(config, overrides, None, url=url, robot_name=robot_name)
    listener = options.listen(lab, None if release else err.print)
    if all_robots:
        _order_all(listener, lab, release=release)
    else:
        _order_one(listener, lab, release=release)


def _order_one(listener: Listener, lab: LabConfig, *, release: bool) -> None:
    from koopman_lab.bus.channels import ONBOARD_STATUS
    from koopman_lab.errors import LabStateError
    from offboard.desk.orders import TRIES, WAIT_S, stop_order

    newest: deque[lcmtypes.onboard_status_t] = deque(maxlen=1)
    listener.subscribe(ONBOARD_STATUS, newest.append)
    order = stop_order(lambda: newest[0] if newest else None, release=release)
    while (obeyed := order.step(listener)) is None:
        listener.spin(WAIT_S)
    if obeyed:
        err.print("released" if release else "stopped; `klab estop --release` releases it")
        return
    answer = "does not confirm" if newest else "is silent"
    if listener.without_key(ONBOARD_STATUS):
        answer += ", and what was said without the lab's key is not believed"
    raise LabStateError(
        f"{ONBOARD_STATUS.name(lab.robot.name)} {answer}: the message was sent {TRIES} times on "
        f"{lab.bus.url}; cut the power if the robot moves"
    )


def _order_all(listener: Listener, lab: LabConfig, *, release: bool) -> None:
    from koopman_lab.errors import LabStateError
    from offboard.desk.orders import TRIES
    from offboard.monitor.robots_heard import RobotsHeard

    heard = RobotsHeard()
    listener.overhear(heard.take)
    obeyed = _give_orders(listener, heard, lab.robot.name, release=release)
    now_us = listener.now_us()
    # Who is heard for the first time now, or is a replay no more, was given no order. Who has
    # obeyed is no log, however wrong the clock here is.
    live = [name for name in obeyed if obeyed[name] or name in heard.live(now_us)]
    nobody = "" if live else "no robot was heard, and "
    live = live or [lab.robot.name]
    for name in sorted(set(heard.replayed(now_us)) - set(live)):
        err.print(one_line(f"{name}: a log that is sent again; nobody is there to obey"))
    if not release and any(obeyed.get(name) for name in live):
        err.print("`klab estop --all --release` releases them")
    refused = [name for name in live if not obeyed.get(name)]
    if refused:
        silent = [name for name in refused if heard.status(name, now_us) is None]
        answers = [
            one_line(f"{name} {'is silent' if name in silent else 'does not confirm'}")
            for name in refused
        ]
        raise LabStateError(
            f"{nobody}{', '.join(answers)}: the message was sent {TRIES} times on {lab.bus.url}; "
            "cut the power if the robot moves"
        )


def _give_orders(
    listener: Listener, heard: RobotsHeard, configured: str, *, release: bool
) -> dict[str, bool]:
    """Stop or release each robot as soon as it is heard; return which obeyed.

    Who is not heard yet may hear all the same: the configured robot is stopped from the first
    moment on, but released only if no other is heard.
    """
    from koopman_lab.units import US_PER_S
    from offboard.desk.orders import WAIT_S, stop_order
    from offboard.lab.present_nodes import LISTEN_S

    orders: dict[str, tuple[Order[Any], Sender]] = {}
    obeyed: dict[str, bool] = {}
    heard_all_us, due_us = listener.now_us() + round(LISTEN_S * US_PER_S), 0
    while True:
        now_us = listener.now_us()
        listening = now_us < heard_all_us
        names = heard.live(now_us)
        if not names and not (release and listening):
            names = [configured]
        for name in set(names) - orders.keys():
            order = stop_order(partial(_status, heard, name, listener), release=release)
            orders[name] = order, listener.speaking_to(name)
        # A busy bus wakes the listener a thousand times a second.
        if now_us >= due_us:
            due_us = now_us + round(WAIT_S * US_PER_S)
            for name in sorted(orders.keys() - obeyed.keys()):
                order, sender = orders[name]
                answer = order.step(sender)
                if answer is not None:
                    obeyed[name] = answer
                if answer:
                    err.print(one_line(f"{name}: {'released' if release else 'stopped'}"))
        if not listening and len(obeyed) == len(orders):
            return obeyed
        listener.spin(WAIT_S)


def _status(heard: RobotsHeard, name: str, listener: Listener) -> lcmtypes.onboard_status_t | None:
    return heard.status(name, listener.now_us())
