"""The stage cost that a configuration asks for, with its weights.

The costs themselves are in `koopman_lab.mpc.stage_costs`, the table of their names in
`koopman_lab.config.cost_table`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from koopman_lab.config.controller import Controller
from koopman_lab.config.cost_table import COSTS, Cost, weighs_states
from koopman_lab.errors import ConfigError
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.mpc.stage_costs import StageCost
from koopman_lab.robots.robot_type import RobotType


class StageWeights(NamedTuple):
    """Weights of a stage cost.

    Attributes
    ----------
    names
        Names of what q weighs: states, or observables.
    q, r
        A weight for each of the names, and one for each input.
    """

    names: tuple[str, ...]
    q: Sequence[float]
    r: Sequence[float]


def stage_cost(
    settings: Controller, robot: RobotType, observables: Dictionary | None = None
) -> StageCost:
    """Return the stage cost a configuration asks for.

    Parameters
    ----------
    settings, robot, observables
        See :func:`stage_weights`.

    Raises
    ------
    ConfigError, PluginError
        See :func:`stage_weights`.
    """
    row = COSTS.get(settings.cost)
    weights = stage_weights(settings, robot, observables)
    build = COSTS.load(row.name, row.factory)
    cost: StageCost = build(weights.q, weights.r, robot, observables)
    return cost


def stage_weights(
    settings: Controller, robot: RobotType, observables: Dictionary | None = None
) -> StageWeights:
    """Return the weights of the cost that a configuration asks for.

    Parameters
    ----------
    settings
        Name and weights of the cost; where it has no weights, the cost itself may.
    robot
        The robot whose states and inputs are weighted.
    observables
        The dictionary, for a cost of observables.

    Raises
    ------
    ConfigError
        If there are no weights for it, or not as many as it weighs states or observables, and
        inputs.
    PluginError
        If it is another package's, and cannot be used.
    """
    row = COSTS.get(settings.cost)
    q, r = _configured_weights(row, settings, robot)
    q_names, q_owner, q_noun, hint = robot.state_names, f"the {robot.name} robot", "states", ""
    if row.weighs == "observables":
        dictionary = _required_dictionary(row, observables)
        q_names, q_owner, q_noun = (
            dictionary.names,
            f"the dictionary {dictionary.name}",
            "observables",
        )
        q, hint = q if len(q) > 1 else tuple(q) * len(q_names), "one weight for all of them, or "
    for key, weights, owner, noun, weighted, more in (
        ("q", q, q_owner, q_noun, q_names, hint),
        ("r", r, f"the {robot.name} robot", "inputs", robot.input_names, ""),
    ):
        if len(weights) != len(weighted):
            raise ConfigError(
                f"controller.weights.{row.name}.{key} has {len(weights)} weights, {owner} has "
                f"{len(weighted)} {noun}; give {more}one for each of {', '.join(weighted)}"
            )
    return StageWeights(q_names, q, r)


def _configured_weights(
    row: Cost, settings: Controller, robot: RobotType
) -> tuple[Sequence[float], Sequence[float]]:
    weights = settings.weights.get(row.name)
    if weights is not None:
        return weights.q, weights.r
    if row.weights is None:
        raise ConfigError(
            f"controller.weights lacks the cost {row.name!r}; add controller.weights.{row.name} "
            "with q and r"
        )
    return row.weights(robot)


def _required_dictionary(row: Cost, observables: Dictionary | None) -> Dictionary:
    if observables is None:
        state_costs = " or ".join(filter(weighs_states, COSTS.builtin_names()))
        raise ConfigError(
            f"controller.cost is {row.name}, which needs a dictionary; choose {state_costs}"
        )
    return observables
