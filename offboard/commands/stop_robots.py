"""Stops or releases one robot or all of them, and says who obeys.

It loads little, so that the first message goes out soon after its command was typed.
"""

from __future__ import annotations

import signal
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
_SENT_ON = "it is sent on until the robot confirms; Ctrl-C ends that"


def _tries(limit_s: float | None, *, release: bool) -> int | None:
    """Return after how many messages an order is given up, None for never.

    A stop that nobody confirms may be on its way to a robot that comes back; who releases one waits
    for an answer.
    """
    if limit_s is not None:
        return max(1, round(limit_s / WAIT_S))
    if release:
        return TRIES
    # It ends by Ctrl-C alone, also where the shell that started it had that ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    return None


def order_one(
    listener: Listener,
    lab: LabConfig,
    *,
    release: bool,
    say: Callable[[str], None],
    limit_s: float | None = None,
) -> None:
    """Stop or release the robot of a lab.

    A stop is sent until the robot confirms it, unless there is a limit, or the robot stands and
    says why it cannot confirm.

    Parameters
    ----------
    listener
        Of that robot.
    lab
        Whose names of robot and bus are used.
    release
        Release instead of stopping.
    say
        Is told that the robot obeys, and of a stop that it does not so far.
    limit_s
        After how long to give up (s).

    Raises
    ------
    LabStateError
        If it does not.
    """
    newest: deque[lcmtypes.onboard_status_t] = deque(maxlen=1)
    tries = _tries(limit_s, release=release)
    order = stop_order(lambda: newest[0] if newest else None, release=release, tries=tries)

    def in_vain() -> str:
        answer = _unconfirmed(newest[0] if newest else None)
        if listener.without_key(ONBOARD_STATUS):
            answer += ", and what was said without the lab's key is not believed"
        return _sent_in_vain(
            f"{ONBOARD_STATUS.name(lab.robot.name)} {answer}", order.sent_times, lab, release
        )

    # Before it listens, which begins with LCM's trial of the bus.
    if not release:
        order.step(listener)
    listener.subscribe(ONBOARD_STATUS, newest.append)
    while (obeyed := order.step(listener)) is None:
        if order.sent_times == TRIES and tries is None:
            if newest and why_stopped(newest[0]):
                raise LabStateError(in_vain())
            say(f"{in_vain()}; {_SENT_ON}")
        listener.spin(WAIT_S)
    if not obeyed:
        raise LabStateError(in_vain())
    say("released" if release else "stopped; `klab estop --release` releases it")


def _sent_in_vain(answers: str, sent_times: int, lab: LabConfig, release: bool) -> str:
    return (
        f"{answers}: the message was sent {sent_times} times on {lab.bus.url}; "
        f"{_NEXT_STEP[release]}"
    )


def _unconfirmed(status: lcmtypes.onboard_status_t | None) -> str:
    """Return in words how a robot answers that does not do as it was ordered."""
    if status is None:
        return "is silent"
    why = why_stopped(status)
    return f"does not confirm ({why})" if why else "does not confirm"


def order_all(
    listener: Listener,
    lab: LabConfig,
    *,
    release: bool,
    say: Callable[[str], None],
    limit_s: float | None = None,
) -> None:
    """Stop or release all robots that are heard; as :func:`order_one`."""
    from offboard.monitor.robots_heard import RobotsHeard

    heard = RobotsHeard()
    if not release:
        # As in order_one; the others are told as soon as they are heard.
        stop_order(lambda: None, release=False).step(listener)
    listener.overhear(heard.take)
    tries = _tries(limit_s, release=release)
    obeyed = _give_orders(listener, heard, lab, release=release, say=say, tries=tries)
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
            _sent_in_vain(f"{nobody}{', '.join(answers)}", tries or TRIES, lab, release)
        )


def _give_orders(
    listener: Listener,
    heard: RobotsHeard,
    lab: LabConfig,
    *,
    release: bool,
    say: Callable[[str], None],
    tries: int | None,
) -> dict[str, bool]:
    """Stop or release each robot as soon as it is heard; return which obeyed.

    Who is not heard yet may hear all the same: the configured robot is stopped from the first
    moment on, but released only if no other is heard. Without a number of ``tries`` this ends when
    all that are heard have obeyed, and the configured one where none is.
    """
    orders: dict[str, tuple[Order[Any], Sender]] = {}
    obeyed: dict[str, bool] = {}
    heard_all_us, due_us = listener.now_us() + round(LISTEN_S * US_PER_S), 0
    while True:
        now_us = listener.now_us()
        listening = now_us < heard_all_us
        names = heard.live(now_us)
        if not names and not (release and listening):
            names = [lab.robot.name]
        for name in set(names) - orders.keys():
            status = partial(_status, heard, name, listener)
            order = stop_order(status, release=release, tries=tries)
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
                elif order.sent_times == TRIES and tries is None:
                    newest = heard.status(name, now_us)
                    if newest is not None and why_stopped(newest):
                        obeyed[name] = False
                        continue
                    answers = one_line(f"{name} {_unconfirmed(newest)}")
                    say(f"{_sent_in_vain(answers, TRIES, lab, release)}; {_SENT_ON}")
        if not listening and set(orders if tries else names) <= obeyed.keys():
            return obeyed
        listener.spin(WAIT_S)


def _status(heard: RobotsHeard, name: str, listener: Listener) -> lcmtypes.onboard_status_t | None:
    return heard.status(name, listener.now_us())
