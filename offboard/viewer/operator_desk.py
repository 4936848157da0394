"""What the page's server does on the bus: it hears all robots, and sends what a person orders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from koopman_lab.bus.age import is_current
from koopman_lab.bus.channels import REPLAY_CONTROL
from koopman_lab.bus.lab_key import key_text
from koopman_lab.bus.realtime import Listener
from koopman_lab.bus.realtime_port import RealtimePort
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.replay.bus_steering import Control, control_message
from koopman_lab.units import US_PER_S
from offboard.desk.goal_message import goal_order
from offboard.desk.orders import WAIT_S, Order, stop_order
from offboard.monitor.lab_view import LabView
from offboard.monitor.robot_view import RobotView
from offboard.viewer.request import ARM, GOAL, RELEASE, REPLAY, STOP, Request

ARMED_S = 10.0
"""So long after its first step the second step of a release is taken."""
SETTLED_S = 0.5
"""A second step sooner after the first is the end of a double click."""
OLDEST_PICTURE_S = 2.0
"""Whoever steers must have seen the lab as it is; STOP is always obeyed."""

A_REPLAY = "this is a replay, or this computer's clock is wrong; a log cannot be steered"
Reply = Callable[[bool, str], None]
"""Told whether an order was obeyed, and what to say of it."""


class OperatorDesk:
    """Keeps the state of the page and sends what a person orders.

    Parameters
    ----------
    config
        Of the lab: the bus, and what to assume of a robot that does not say its configuration.
    robot_known
        Whether the configuration is that of the robot it names, and not an assumption.

    Raises
    ------
    BusError
        If the bus cannot be opened.
    """

    def __init__(self, config: LabConfig, *, robot_known: bool = False) -> None:
        self.view = LabView(config, config.robot.name if robot_known else None)
        self._listener = Listener(config)
        self._listener.overhear(self.view.take, self.view.refuse)
        self.key_text = key_text(config)
        """Who may speak on the bus."""
        self._publishers: dict[str, RealtimePort] = {}
        self._orders: dict[tuple[str, str], tuple[Order[Any], Reply, str]] = {}
        self._armed_us: dict[tuple[object, str], int] = {}
        self._resend_us = 0

    def now_us(self) -> int:
        """Return the present time (us)."""
        return self._listener.now_us()

    @property
    def ordering(self) -> bool:
        """Return whether something was ordered that is not obeyed yet."""
        return bool(self._orders)

    def repeat_orders(self) -> None:
        """Take everything that has arrived, and say again what is not obeyed yet."""
        self._listener.spin(0.0)
        now_us = self.now_us()
        if now_us < self._resend_us:
            return
        self._resend_us = now_us + round(WAIT_S * US_PER_S)
        for key, (order, reply, order_text) in list(self._orders.items()):
            obeyed = order.step(self._publisher(key[0]))
            if obeyed is not None:
                del self._orders[key]
                confirmation = (
                    "confirmed" if obeyed else "not confirmed; cut the power if the robot moves"
                )
                reply(obeyed, f"{key[0]}: {order_text} {confirmation}")

    def handle(self, request: Request, page: object, reply: Reply) -> None:
        """Do what a page asks for; ``reply`` is called at most once, perhaps later.

        Parameters
        ----------
        request
            What is asked for.
        page
            Who asks: releasing takes two steps of the same one.
        reply
            Told how it went.

        Raises
        ------
        LabStateError
            If it is refused.
        """
        if request.control is not None:
            self._steer_replay(request.robot, request.control, reply)
            return
        robot = self._robot(request.robot, stopping=request.do == STOP)
        now_us, armed = self.now_us(), (page, robot.name)
        if request.do != STOP:
            self.require_fresh(request)
        if request.do == STOP:
            # Nothing that was ordered before may undo it.
            for key in [key for key in self._orders if key[0] == robot.name]:
                del self._orders[key]
            self._armed_us.pop(armed, None)
            order = stop_order(lambda: robot.status(self.now_us()), release=False)
            if not robot.replayed(now_us) or robot.alive(now_us):
                self._begin(robot.name, STOP, order, reply, "STOP")
                return
            # Where the clock here is wrong, a robot looks like a log, and may well obey.
            self._begin(robot.name, STOP, order, _only_good(reply), "STOP")
            raise LabStateError(f"{robot.name}: {A_REPLAY}; STOP was sent all the same")
        if request.do == ARM:
            self._armed_us[armed] = now_us
            reply(True, f"{robot.name}: confirm the release within {ARMED_S:g} s")
        elif request.do == RELEASE:
            since_us = self._armed_us.get(armed)
            if since_us is not None and now_us - since_us < SETTLED_S * US_PER_S:
                raise LabStateError(f"{robot.name}: a double click releases nothing; confirm again")
            self._armed_us.pop(armed, None)
            if since_us is None or now_us - since_us > ARMED_S * US_PER_S:
                raise LabStateError(f"{robot.name}: releasing takes two steps; begin again")
            order = stop_order(lambda: robot.status(self.now_us()), release=True)
            self._orders.pop((robot.name, STOP), None)
            self._begin(robot.name, RELEASE, order, reply, "release")
        elif request.goal is not None:
            if robot.mpc(now_us) is None:
                raise LabStateError(
                    f"{robot.name}: no controller speaks; `klab park` starts one, then a goal can "
                    "be set"
                )
            move = goal_order(request.goal, robot.config, lambda: robot.mpc(self.now_us()))
            x1, x2, _ = request.goal
            self._begin(robot.name, GOAL, move, reply, f"goal ({x1:.2f}, {x2:.2f}) m")

    def require_fresh(self, request: Request) -> None:
        """Refuse what was asked for on an old picture of the lab.

        Raises
        ------
        LabStateError
            If it was.
        """
        now_us = self.now_us()
        seen_us = now_us if request.seen_us is None else request.seen_us
        if not is_current(seen_us, now_us, OLDEST_PICTURE_S * US_PER_S):
            age_s = (now_us - seen_us) / US_PER_S
            prefix = f"{request.robot}: " if request.robot else ""
            raise LabStateError(
                f"{prefix}not done, since it was asked for on a picture {age_s:.0f} s old; "
                "look, and ask again"
            )

    def forget(self, page: object) -> None:
        """Forget a page that is gone."""
        for key in [key for key in self._armed_us if key[0] is page]:
            del self._armed_us[key]

    def _steer_replay(self, name: str, control: Control, reply: Reply) -> None:
        """Ask the replay of a robot's log for something; what was asked for before is dropped."""
        robot, number = self.view.robots.get(name), self.now_us()
        if robot is None or robot.replay_progress.control(number) is None:
            raise LabStateError(
                f"{name[:32]}: no replay can be steered; `klab replay LOG --url URL` sends one on "
                "the bus of this page"
            )

        def obeyed() -> bool:
            return (robot.replay_progress.control(self.now_us()) or 0) >= number

        def answer(good: bool, said: str) -> None:
            del said
            if not good:
                reply(False, f"{name}: the replay does not answer")

        order = Order(REPLAY_CONTROL, lambda utime: control_message(control, number, utime), obeyed)
        self._begin(name, REPLAY, order, answer, REPLAY)

    def _begin(
        self, name: str, action: str, order: Order[Any], reply: Reply, order_text: str
    ) -> None:
        order.step(self._publisher(name))
        self._orders[name, action] = order, reply, order_text

    def _robot(self, name: str, *, stopping: bool) -> RobotView:
        robot, now_us = self.view.robots.get(name), self.now_us()
        if robot is None:
            known = ", ".join(sorted(self.view.robots)) or "none"
            raise LabStateError(f"{name[:32]!r}: no such robot; heard so far: {known}")
        if stopping:
            return robot  # also where it is silent: it may still hear, and move
        if robot.replayed(now_us):
            raise LabStateError(f"{name}: {A_REPLAY}")
        if not robot.alive(now_us):
            raise LabStateError(f"{name}: nobody speaks for this robot")
        return robot

    def _publisher(self, name: str) -> RealtimePort:
        publisher = self._publishers.get(name)
        if publisher is None:
            publisher = self._publishers[name] = self._listener.speaking_to(name)
        return publisher


def _only_good(reply: Reply) -> Reply:
    """Return a reply that says nothing of an order that nobody obeys."""
    return lambda good, said: reply(good, said) if good else None
