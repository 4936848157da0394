"""The one table of processes: what each is, what it needs, when it stops, and who may stop it.

Whatever else names processes derives from it: heartbeats, commanders, priorities, the commands of
`klab run`, the order in which a lab stops, the page and `klab status`.

Another package adds a node by an entry point of the group ``koopman_lab.nodes``, whose name is
that of the node and whose value a :class:`Process`::

    [project.entry-points."koopman_lab.nodes"]
    lidar = "my_package.row:LIDAR"

    # my_package/row.py, which imports nothing heavy
    LIDAR = Process("lidar", "my_package.node:LidarNode", needs=("onboard",))

Its factory takes the configuration and returns the node, whose ``name`` is that of the row. It runs
by `klab run lidar`, or with a lab by `klab up --with lidar`. Its heartbeat ``LIDAR_HEARTBEAT`` is
logged, and `klab status` and the page show it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import lcmtypes
from koopman_lab.bus.priority import PRIORITY
from koopman_lab.errors import PluginError
from koopman_lab.registry import Registry

if TYPE_CHECKING:
    from koopman_lab.bus.channel import Channel

_ROLES = lcmtypes.velocity_command_t
OPERATOR_ROLE: int = _ROLES.OPERATOR
MOST_ROLES = 8
"""Roles are numbers from 1 to below this."""


class Stop(IntEnum):
    """In which order the processes of a lab stop."""

    COMMANDER = 0
    """First, so that the robot comes to rest while it is still heard."""
    DESK = 1
    """What only listens to the robot."""
    BOARD = 2
    HARDWARE = 3
    """Motors and cameras, or what stands in for them."""
    LOGGER = 4
    """Writes down how the others end."""
    ONLOOKER = 5


_COMMAND = "the command that started it"
STARTER = f"{_COMMAND}, by Ctrl-C or `klab down`"


@dataclass(frozen=True)
class Process:
    """One row: a node, and the process that it runs in.

    Attributes
    ----------
    name
        What the node is called, as in ``klab run NAME``.
    factory
        Returns the node; called with the configuration and, for our own nodes, what else their
        command is given. A callable, or where it is, as ``module:attribute``; empty for a process
        that is no node on the bus.
    needs
        Nodes without which it has nothing to do.
    stopped_by
        Who may stop it, in words; whatever else ends it is a crash.
    stops
        When it stops among the processes of a lab.
    role
        A node that commands the robot has one: the number by which the motor loop knows it
        (`koopman_lab.bus.commanders`). 5 to 7 are for nodes that others add.
    priority
        Real-time priority of its process, where the system lets us choose.
    hidden
        Whether `klab run --help` leaves it out.
    rebuild
        Returns the node as it was for a recorded session, for `klab rerun`: takes configuration,
        session and model file. Empty for a node that cannot be run again.
    channels
        Channels that only this node publishes, besides its heartbeat; those of our own nodes are in
        `koopman_lab.bus.channels` instead.

    Raises
    ------
    ValueError
        If a role or a priority is none.
    """

    name: str
    factory: str | Callable[..., Any]
    needs: tuple[str, ...] = ()
    stopped_by: str = STARTER
    stops: Stop = Stop.DESK
    role: int | None = None
    priority: int = PRIORITY
    hidden: bool = False
    rebuild: str | Callable[..., Any] = ""
    channels: tuple[Channel[Any], ...] = ()

    def __post_init__(self) -> None:
        if self.role is not None and not 0 < self.role < MOST_ROLES:
            raise ValueError(f"role {self.role} of {self.name}: expected 1 to {MOST_ROLES - 1}")
        if not 1 <= self.priority <= 99:
            raise ValueError(f"priority {self.priority} of {self.name}: expected 1 to 99")

    @property
    def commands(self) -> bool:
        """Return whether it commands the robot; such a node may also end by itself."""
        return self.role is not None


_ROWS = (
    Process(
        "sampler",
        "offboard.sampler.node:SamplerNode",
        needs=("onboard", "logger"),
        stopped_by="itself when done, or `klab calibrate`",
        stops=Stop.COMMANDER,
        role=_ROLES.SAMPLER,
        rebuild="offboard.lab.rebuild:sampler",
    ),
    Process(
        "controller",
        "offboard.controller.node:ControllerNode",
        needs=("onboard", "logger"),
        stopped_by="itself when done, or `klab park`",
        stops=Stop.COMMANDER,
        role=_ROLES.CONTROLLER,
        rebuild="offboard.lab.rebuild:controller",
    ),
    Process(
        "reference",
        "offboard.reference.node:ReferenceNode",
        needs=("onboard", "logger"),
        stopped_by="itself when done, or `klab reference`",
        stops=Stop.COMMANDER,
        role=_ROLES.REFERENCE,
        rebuild="offboard.lab.rebuild:reference",
    ),
    Process(
        "slalom",
        "offboard.bench.slalom:Slalom",
        needs=("onboard",),
        stopped_by="`klab bench stop`",
        stops=Stop.COMMANDER,
        role=OPERATOR_ROLE,
        hidden=True,
    ),
    Process(
        "onboard",
        "onboard.motor_loop.node:OnboardNode",
        needs=("plant",),
        stops=Stop.BOARD,
        priority=11,
        rebuild="offboard.lab.rebuild:onboard",
    ),
    Process("plant", "onboard.plant.node:PlantNode", stops=Stop.HARDWARE, priority=12),
    Process("driver", "koopman_lab.bus.hardware:driver", stops=Stop.HARDWARE, priority=12),
    Process("mocap", "koopman_lab.bus.hardware:mocap", stops=Stop.HARDWARE, priority=12),
    Process("logger", "offboard.logger.node:LoggerNode", stops=Stop.LOGGER),
    Process("view", "", stops=Stop.ONLOOKER, hidden=True),
    Process(
        "pacer",
        "offboard.bench.pacer:Pacer",
        stopped_by="`klab bench realtime`",
        stops=Stop.ONLOOKER,
        priority=11,
        hidden=True,
    ),
)
PROCESSES: Registry[Process] = Registry(
    "node", "koopman_lab.nodes", Process, {row.name: row for row in _ROWS}
)
STANDING = ("plant", "onboard", "logger")
"""What a lab is without anybody who commands: in the order in which they act at equal times."""


def process(name: str) -> Process:
    """Return the row of a process, also where the row that another package adds cannot be used.

    What was started elsewhere may speak here all the same.

    Raises
    ------
    ConfigError
        If there is no such process.
    """
    try:
        return PROCESSES.builtin_row(name) or PROCESSES.get(name)
    except PluginError:
        return Process(name, "")


def in_stop_order() -> list[Process]:
    """Return the rows in the order in which their processes stop."""
    return sorted(map(process, PROCESSES.names()), key=lambda row: row.stops)


def stopping(*stops: Stop) -> frozenset[str]:
    """Return the names of the processes that stop at one of these places in the order."""
    return frozenset(row.name for row in in_stop_order() if row.stops in stops)


def commanders() -> frozenset[str]:
    """Return the names of the nodes that command the robot, one of them at a time."""
    return frozenset(row.name for row in in_stop_order() if row.commands)


def build(name: str, *arguments: Any, **options: Any) -> Any:
    """Return the node of a row, a :class:`~koopman_lab.bus.node.Node`.

    Parameters
    ----------
    name
        Which row.
    *arguments, **options
        Given to its factory: the configuration first.

    Raises
    ------
    ConfigError
        If there is no such row.
    PluginError
        If it is another package's, and cannot be used.
    """
    row = PROCESSES.get(name)
    node = PROCESSES.load(name, row.factory)(*arguments, **options)
    if node.name != name:
        raise PluginError(
            f"{PROCESSES.origin(name)}: its node calls itself {node.name!r}, so that nobody would "
            "know its heartbeat; mend or uninstall it"
        )
    return node


def priority_of(name: str) -> int:
    """Return the priority of a node's process, also of a node that is in no table."""
    return process(name).priority if name in PROCESSES else PRIORITY


def died(message: lcmtypes.process_t) -> str:
    """Return in words which process died, and how."""
    return f"{message.name} died ({message.ended})"


def who_stops(row: Process, started: lcmtypes.process_t | None) -> str:
    """Return in words who may stop a process; a command that speaks of it, by its number."""
    if started is None:
        return row.stopped_by
    return row.stopped_by.replace(_COMMAND, f"process {started.supervisor_pid}")
