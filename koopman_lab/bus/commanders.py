"""Who commands a robot: a role in a process, as the one number that messages carry.

Two controllers are two commanders, so the number tells processes apart, too. Desks that share a
robot could in rare cases have processes of the same number; roles still differ.
"""

from __future__ import annotations

from koopman_lab.bus.channel import OPERATOR
from koopman_lab.bus.processes import MOST_ROLES, OPERATOR_ROLE, in_stop_order, process
from koopman_lab.errors import ConfigError

NOBODY = 0
"""Stands for no commander: the robot is free."""


def commander_number(node: str, process_number: int) -> int:
    """Return the number of a node that commands, in a process; in lockstep that is process 0.

    The number is the node's role plus :data:`~koopman_lab.bus.processes.MOST_ROLES` times that of
    the process.

    Raises
    ------
    ConfigError
        If the node has no role by which the motor loop could know it.
    """
    role = process(node).role
    if role is None:
        raise ConfigError(f"{node}: has no role in the table of processes, so it commands nobody")
    return role + MOST_ROLES * process_number


def commander_name(number: int) -> str:
    """Return who it is in words, for example ``sampler (process 4711)``."""
    process_number, role = divmod(number, MOST_ROLES)
    names = {row.role: row.name for row in in_stop_order()} | {OPERATOR_ROLE: OPERATOR}
    name = names.get(role, f"commander {role}")
    return f"{name} (process {process_number})" if process_number else name
