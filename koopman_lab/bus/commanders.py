"""Who commands a robot: a role in a process, as the one number that messages carry.

Two controllers are two commanders, so the number tells processes apart, too. Desks that share a
robot could in rare cases have processes of the same number; roles still differ.
"""

from __future__ import annotations

import lcmtypes

_ROLES = lcmtypes.velocity_command_t
NAMES = {
    _ROLES.SAMPLER: "sampler",
    _ROLES.CONTROLLER: "controller",
    _ROLES.OPERATOR: "operator",
    _ROLES.REFERENCE: "reference",
}
NOBODY = 0
"""In place of a commander's number: the robot is free."""
SHARE = 8
"""The number is the role plus so many times the process; in lockstep there is one process, 0."""


def commander_number(role: int, process: int) -> int:
    """Return the number of a role (a constant of the command messages) in a process."""
    return role + SHARE * process


def commander_name(number: int) -> str:
    """Return who it is in words, for example ``sampler (process 4711)``."""
    process, role = divmod(number, SHARE)
    name = NAMES.get(role, f"commander {role}")
    return f"{name} (process {process})" if process else name
