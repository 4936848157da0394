"""Whether a configuration has as many numbers as its kind of robot has states and inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from koopman_lab.config.cost_table import weighs_states
from koopman_lab.robots.robot_type import RobotType

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


class RobotMisfitError(ValueError):
    """A value does not fit the robot.

    Parameters
    ----------
    key
        The value's dotted key.
    reason
        What the robot has, and what was found.
    """

    def __init__(self, key: str, reason: str) -> None:
        super().__init__(f"{key}: {reason}")
        self.key = tuple(key.split("."))
        self.reason = reason


def require_fit(config: LabConfig, robot: RobotType) -> None:
    """Refuse what does not fit the robot.

    Raises
    ------
    RobotMisfitError
        If there are too few or too many numbers somewhere, or bounds of what is not there.
    """
    states = _count_and_names("states", robot.state_names)
    for cost, weights in config.controller.weights.items():
        if weighs_states(cost) and len(weights.q) != robot.state_dim:
            raise RobotMisfitError(
                f"controller.weights.{cost}.q",
                f"the {robot.name} robot has {states}, found {len(weights.q)} weights",
            )
    for key, values in _values_of_inputs(config):
        if len(values) != robot.input_dim:
            inputs = _count_and_names("inputs", robot.input_names)
            raise RobotMisfitError(key, f"the {robot.name} robot has {inputs}, found {len(values)}")
    _require_speeds(config.controller.speed_max, robot)
    count = len(config.sampler.basis_inputs)
    if count not in robot.basis_counts:
        names = [f"u_{i}" for i in range(robot.input_dim + 1)]
        choices = [", ".join(names[-k:]) for k in robot.basis_counts]
        raise RobotMisfitError(
            "sampler.basis_inputs",
            f"expected {' or '.join(choices)} of the {robot.name} robot, found {count} inputs",
        )


def _values_of_inputs(config: LabConfig) -> Iterator[tuple[str, Sequence[float]]]:
    """Give what has a number for each input, by its key."""
    yield "controller.u_max", config.controller.u_max
    for cost, weights in config.controller.weights.items():
        yield f"controller.weights.{cost}.r", weights.r
    for index, u in enumerate(config.sampler.basis_inputs):
        yield f"sampler.basis_inputs.{index}", u


def _require_speeds(speed_max: Sequence[float] | None, robot: RobotType) -> None:
    if speed_max is None:
        return
    if not robot.speeds_at:
        raise RobotMisfitError(
            "controller.speed_max",
            f"the state of the {robot.name} robot holds no velocity; its inputs "
            f"({', '.join(robot.input_names)}) are bounded by controller.u_max",
        )
    if len(speed_max) != len(robot.speeds_at):
        names = [robot.state_names[i] for i in robot.speeds_at]
        raise RobotMisfitError(
            "controller.speed_max",
            f"the {robot.name} robot has {_count_and_names('velocities', names)}, "
            f"found {len(speed_max)}",
        )


def _count_and_names(what: str, names: Sequence[str]) -> str:
    return f"{len(names)} {what} ({', '.join(names)})"
