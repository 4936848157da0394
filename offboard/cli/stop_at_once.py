"""`klab estop` without the command line: on a busy machine loading it takes seconds.

It reads from the configuration only how the robot and its bus are called, and sends the stop.
Nothing is validated on the way: whoever stops a robot is not to wait for it. What it does not
understand is left to the command line, which explains it.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

FLAGS = {"--release": "release", "--all": "all_robots"}
VALUES = {"--config": "config", "--robot-name": "robot_name", "--url": "url"}
SECONDS = {"--limit-s": "limit_s"}
REPEATED = {"--set": "overrides"}
LEAST_LIMIT_S = 0.02
"""As the command line says."""


class Order(NamedTuple):
    """What a person typed behind ``klab estop``."""

    release: bool = False
    all_robots: bool = False
    config: str | None = None
    robot_name: str | None = None
    url: str | None = None
    limit_s: float | None = None
    overrides: tuple[str, ...] = ()


def stop_at_once(arguments: Sequence[str]) -> int | None:
    """Stop or release the robot; return the exit code, None if that is left to the command line.

    Parameters
    ----------
    arguments
        What stands behind ``klab estop``.
    """
    order = parse(arguments)
    lab = None if order is None else addresses(order)
    if order is None or lab is None:
        return None
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.errors import LabError
    from offboard.commands.stop_robots import order_all, order_one
    from offboard.terminal.exit_codes import code_of
    from offboard.terminal.visible_text import visible

    def say(text: str) -> None:
        # A terminal that has gone, or a full disk, stops no stop.
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(f"{visible(text)}\n")
            sys.stderr.flush()

    act = order_all if order.all_robots else order_one
    try:
        # A key that cannot be used keeps nobody from stopping a robot.
        listener = Listener(lab, None if order.release else say)
        act(listener, lab, release=order.release, say=say, limit_s=order.limit_s)
    except LabError as error:
        say(f"klab: {error}")
        return code_of(error)
    return 0


def parse(arguments: Sequence[str]) -> Order | None:
    """Return what was typed, None if it is not understood here."""
    values: dict[str, Any] = {}
    overrides: list[str] = []
    rest = list(arguments)
    while rest:
        option, equals, value = rest.pop(0).partition("=")
        if option in FLAGS and not equals:
            values[FLAGS[option]] = True
            continue
        if option not in VALUES and option not in REPEATED and option not in SECONDS:
            return None
        if not equals:
            if not rest:
                return None
            value = rest.pop(0)
        if option in REPEATED:
            overrides.append(value)
        elif option in SECONDS:
            try:
                values[SECONDS[option]] = float(value)
            except ValueError:
                return None
            if not LEAST_LIMIT_S <= values[SECONDS[option]] < math.inf:
                return None
        else:
            values[VALUES[option]] = value
    order = Order(**values, overrides=tuple(overrides))
    return None if order.all_robots and order.robot_name is not None else order


def addresses(order: Order) -> LabConfig | None:
    """Return how robot and bus are called, None if the configuration cannot be read.

    It has only the sections of a configuration that who sends a message looks at.
    """
    from koopman_lab.config.layering import layers_of, merged
    from koopman_lab.errors import LabError

    overrides = list(order.overrides)
    if order.robot_name is not None:
        overrides.append(f"robot.name={order.robot_name}")
    if order.url is not None:
        overrides.append(f"bus.url={order.url}")
    try:
        values = merged(
            layers_of(
                None if order.config is None else Path(order.config),
                bus_url=os.environ.get("LCM_DEFAULT_URL"),
                overrides=overrides,
            )
        )
    except LabError:
        return None
    robot, bus = values.get("robot"), values.get("bus")
    if not isinstance(robot, dict) or not isinstance(bus, dict):
        return None
    if not isinstance(robot.get("name"), str) or not isinstance(bus.get("url"), str):
        return None
    if not isinstance(bus.get("key_file"), (str, type(None))):
        return None
    lab = SimpleNamespace(robot=SimpleNamespace(**robot), bus=SimpleNamespace(**bus))
    return cast("LabConfig", lab)
