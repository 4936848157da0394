"""Models that do not care where the robot stands and where it looks (paper, outlook).

Moving and turning a robot together with its path changes nothing for wheels on a level floor. Let
g be such a motion. It acts on the pose, with which the states of every robot begin; what stands
behind the pose, such as speeds ahead and about the axis, moves with the robot and stays as it is.
Where a dictionary is closed under it, psi(g x) = T(g) psi(x), the matrix of each basis input must
satisfy T(g) M = M T(g), which is linear in M and leaves few numbers free.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import ModelError
from koopman_lab.koopman.dictionary import Dictionary

Array = NDArray[np.float64]
MOTIONS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""x1, x2 (m) and angle (rad). What commutes with these commutes with all planar motions: T of
translations is a polynomial in the distance, and multiples of 1 rad come arbitrarily near to every
angle."""
STATES = 200
"""Random states that T is found and checked with."""
CLOSED = 1e-9
"""Largest error of T psi(x), relative to psi, of a dictionary that counts as closed."""


@lru_cache(maxsize=32)
def equivariant_basis(dictionary: Dictionary) -> Array:
    """Return matrices (K, M, M) that span all changes M - I of an equivariant model.

    The row of the constant is zero in each.

    Raises
    ------
    ModelError
        If the dictionary is not closed under planar motions.
    """
    size = dictionary.size
    eye = np.eye(size)
    conditions = [np.kron(eye[:1], eye)]
    for motion in MOTIONS:
        action = _representation(dictionary, motion)
        conditions.append(np.kron(action, eye) - np.kron(eye, action.T))
    _, values, rows = np.linalg.svd(np.vstack(conditions))
    free = rows[np.sum(values > 1e-8 * values[0]) :].reshape(-1, size, size).copy()
    free[:, 0] = 0.0
    return free


def _representation(dictionary: Dictionary, motion: tuple[float, float, float]) -> Array:
    """Return T (M, M) with psi(g x) = T psi(x)."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-2.0, 2.0, (STATES, dictionary.state_dim))
    moved = x.copy()
    c, s = np.cos(motion[2]), np.sin(motion[2])
    moved[:, 0] = motion[0] + c * x[:, 0] - s * x[:, 1]
    moved[:, 1] = motion[1] + s * x[:, 0] + c * x[:, 1]
    moved[:, 2] += motion[2]
    before, after = dictionary.lift(x), dictionary.lift(moved)
    action = np.linalg.lstsq(before, after, rcond=None)[0].T
    errors = np.abs(after - before @ action.T).max(axis=0) / np.abs(after).max(axis=0)
    worst = int(np.argmax(errors))
    if errors[worst] > CLOSED:
        what = "turning by 1 rad" if motion[2] else "moving by 1 m"
        raise ModelError(
            f"dictionary {dictionary.name}: {what} makes of {dictionary.names[worst]!r} something "
            "that its observables do not add up to, so no model of it can be symmetric; add what "
            "is missing, choose another dictionary, or leave out --symmetric"
        )
    return np.where(np.abs(action) < 1e-12, 0.0, action)
