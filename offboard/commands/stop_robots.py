"""Stops or releases one robot or all of them, and says who obeys.

It loads little, so that the first message goes out soon after its command was typed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.motor_loop_faults import why_stopped
from koopman_lab.errors import LabStateError
from koopman_lab.units import US_PER_S
from offboard.desk.orders import TRIES, WAIT_S, stop_order
from offboard.lab.present_nodes import LISTEN_S
from offboard.terminal.visible_text import one_line

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.desk.orders import Order, Sender
    from offboard.monitor.robots_heard import RobotsHeard

_NEXT_STEP = {
    False: "cut the power if the robot moves",
    True: (
        "a stop is released by the onboard program that holds it: start `klab up`, or `klab run "
        "onboard` on its board, and release it then"
    ),
}
"""What a person can do where a robot does not obey, by whether it was to be released."""


def order_one(
    listener: Listener, lab: LabConfig, *, release: bool, say: Callable[[str], None]
) -> None:
    """Stop or release the robot of a lab.

    Parameters
    ----------
    listener
        Of that robot.
    lab
        Whose names of robot and bus are used.
    release
        Release instead of stopping.
    say
        Is told that the robot obeys.

    Raises
    ------
    LabStateError
        If it does not.
    """
    newest: deque[lcmtypes.onboard_status_t] = deque(maxlen=1)
    order = stop_order(lambda: newest[0] if newest else None, release=release)
    # Before it listens, which begins with LCM's trial of the bus.
    if not release:
        order.step(listener)
    listener.subscribe(ONBOARD_STATUS, newest.append)
    while (obeyed := order.step(listener)) is None:
        listener.spin(WAIT_S)
    if obeyed:
        say("released" if release else "stopped; `klab estop --release` releases it")
        return
    answer = _unconfirmed(newest[0] if newest else None)
    if listener.without_key(ONBOARD_STATUS):
        answer += ", and what was said without the lab's key is not believed"
    raise LabStateError(
        f"{ONBOARD_STATUS.name(lab.robot.name)} {answer}: the message was sent {TRIES} times on "
        f"{lab.bus.url}; {_NEXT_STEP[release]}"
    )


def _unconfirmed(status: lcmtypes.onboard_status_t | None) -> str:
    """Return in words how a robot answers that does not do as it was ordered."""
    if status is None:
        return "is silent"
    why = why_stopped(status)
    return f"does not confirm ({why})" if why else "does not confirm"


def order_all(
    listener: Listener, lab: LabConfig, *, release: bool, say: Callable[[str], None]
) -> None:
    """Stop or release all robots that are heard; as :func:`order_one`."""
    from offboard.monitor.robots_heard import RobotsHeard

    heard = RobotsHeard()
    if not release:
        # As in order_one; the others are told as soon as they are heard.
        stop_order(lambda: None, release=False).step(listener)
    listener.overhear(heard.take)
    obeyed = _give_orders(listener, heard, lab.robot.name, release=release, say=say)
    now_us = listener.now_us()
    # Who is heard for the first time now, or is a replay no more, was given no order. Who has
    # obeyed is no log, however wrong the clock here is.
    live = [name for name in obeyed if obeyed[name] or name in heard.live(now_us)]
    nobody = "" if live else "no robot was heard, and "
    live = live or [lab.robot.name]
    for name in sorted(set(heard.replayed(now_us)) - set(live)):
        say(one_line(f"{name}: a log that is sent again; nobody is there to obey"))
    if not release and any(obeyed.get(name) for name in live):
        say("`klab estop --all --release` releases them")
    refused = [name for name in live if not obeyed.get(name)]
    if refused:
        answers = [
            one_line(f"{name} {_unconfirmed(heard.status(name, now_us))}") for name in refused
        ]
        raise LabStateError(
            f"{nobody}{', '.join(answers)}: the message was sent {TRIES} times on {lab.bus.url}; "
            f"{_NEXT_STEP[release]}"
        )


def _give_orders(
    listener: Listener,
    heard: RobotsHeard,
    configured: str,
    *,
    release: bool,
    say: Callable[[str], None],
) -> dict[str, bool]:
    """Stop or release each robot as soon as it is heard; return which obeyed.

    Who is not heard yet may hear all the same: the configured robot is stopped from the first
    moment on, but released only if no other is heard.
    """
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
                    say(one_line(f"{name}: {'released' if release else 'stopped'}"))
        if not listening and len(obeyed) == len(orders):
            return obeyed
        listener.spin(WAIT_S)


def _status(heard: RobotsHeard, name: str, listener: Listener) -> lcmtypes.onboard_status_t | None:
    return heard.status(name, listener.now_us())
