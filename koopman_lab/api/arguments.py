"""Checks what is passed to the public face: shapes and numbers, refused in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from koopman_lab.errors import ArgumentError
from koopman_lab.robots.robot_type import POSE_DIM, RobotType

Array = NDArray[np.float64]
FilePath = str | Path
"""Where a file is."""


def numbers(value: ArrayLike, what: str) -> Array:
    """Return an array of finite numbers.

    Parameters
    ----------
    value
        Numbers, or sequences of them.
    what
        Name of the argument.

    Raises
    ------
    ArgumentError
        If it holds anything but finite numbers.
    """
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{what}: no array of numbers ({error})") from None
    wrong = np.argwhere(~np.isfinite(array))
    if len(wrong):
        place = tuple(wrong[0].tolist())
        raise ArgumentError(f"{what}: {array[place]} at {place}, expected finite numbers")
    return array


def rows(value: ArrayLike, what: str, names: Sequence[str], owner: str, leading: str) -> Array:
    """Return an array whose last axis has a number for each name.

    Parameters
    ----------
    value
        Numbers, or sequences of them.
    what
        Name of the argument.
    names
        What the numbers along the last axis are.
    owner
        Whose they are, in words.
    leading
        The axes before the last one, as the message shows them: ``"..., H"``, ``"..."``, or
        nothing for a single row.

    Raises
    ------
    ArgumentError
        If it holds anything but finite numbers, or another number of them.
    """
    array = numbers(value, what)
    axes = [axis for axis in leading.split(", ") if axis]
    least = 1 + len([axis for axis in axes if axis != "..."])
    fits = array.ndim >= least and array.shape[-1] == len(names)
    if not fits or ("..." not in axes and array.ndim != least):
        expected = f"({', '.join([*axes, str(len(names))])}{'' if axes else ','})"
        raise ArgumentError(
            f"{what}: shape {array.shape}, expected {expected}, the last axis being "
            f"{', '.join(names)} of {owner}"
        )
    return array


def state(value: ArrayLike, robot: RobotType, what: str) -> Array:
    """Return a state (n,) of a robot; of a pose alone (m, m, rad), that at rest.

    Raises
    ------
    ArgumentError
        If it is neither.
    """
    array = numbers(value, what)
    if array.shape == (POSE_DIM,):
        return robot.state(array.tolist())
    return rows(array, what, robot.state_names, f"the {robot.name} robot", "")
