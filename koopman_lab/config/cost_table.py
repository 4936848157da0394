"""The one table of stage costs: what each weighs, and where it is built.

The choices of every command, of ``controller.cost`` and of the keys of ``controller.weights``
derive from it. It stands here because the configuration asks it for names; the costs themselves are
in `koopman_lab.mpc.stage_costs`.

Another package adds one by an entry point of the group ``koopman_lab.costs``, whose name is what a
person types and whose value a :class:`Cost`::

    [project.entry-points."koopman_lab.costs"]
    huber = "my_package.row:HUBER"

    # my_package/row.py, which imports nothing heavy
    HUBER = Cost("huber", "my_package.cost:Huber", weights=lambda robot: (Q, R))

Its factory takes the weights q and r, the robot and its dictionary, None where there is none, and
returns a :class:`~koopman_lab.mpc.stage_costs.StageCost`. `klab park --cost huber` parks with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from koopman_lab.registry import Registry
from koopman_lab.robots.robot_type import RobotType


@dataclass(frozen=True)
class Cost:
    """One stage cost.

    Attributes
    ----------
    name
        As in ``controller.cost`` and ``--cost``.
    factory
        Called with the weights q and r (sequences of numbers), the
        :class:`~koopman_lab.robots.robot_type.RobotType` and the
        :class:`~koopman_lab.koopman.dictionary.Dictionary` or None. A callable, or where it is, as
        ``module:attribute``.
    weighs
        What q has a weight for each of; r has one for each input. Of observables, a single weight
        is that of all.
    weights
        Returns for a robot the q and r of a configuration that has none for this cost; None where
        it must have them.
    """

    name: str
    factory: str | Callable[..., Any]
    weighs: Literal["states", "observables"] = "states"
    weights: Callable[[RobotType], tuple[Sequence[float], Sequence[float]]] | None = None


COSTS: Registry[Cost] = Registry(
    "cost",
    "koopman_lab.costs",
    Cost,
    {
        row.name: row
        for row in (
            Cost("me", "koopman_lab.mpc.stage_costs:mixed_exponents"),
            Cost("ce", "koopman_lab.mpc.stage_costs:quadratic"),
            Cost(
                "ds", "koopman_lab.mpc.stage_costs:quadratic_in_observables", weighs="observables"
            ),
        )
    },
)
"""The built-in costs are those of the paper's section 3.3."""


def known_cost(name: str) -> str:
    """Return the name of a cost that there is.

    Raises
    ------
    ValueError
        If there is none; a row that another package adds is not looked at.
    """
    if name not in COSTS:
        *names, last = map(repr, COSTS.names())
        raise ValueError(f"input should be {', '.join(names)} or {last}")
    return name


def weighs_states(name: str) -> bool:
    """Return whether our own cost of a name weighs states; what others weigh they say later."""
    row = COSTS.builtin_row(name)
    return row is not None and row.weighs == "states"
