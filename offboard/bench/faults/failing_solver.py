"""A solver that fails in its first calls, as many as it is made for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc.solver import Plan, Solver


class FailingSolver:
    """Fails a number of times, and from then on solves.

    Parameters
    ----------
    solver
        What solves.
    times
        Number of calls that fail.
    """

    def __init__(self, solver: Solver, times: float) -> None:
        self.description, self.rollout = solver.description, solver.rollout
        self._solver = solver
        self._left = times

    def disturb(self, d: NDArray[np.float64]) -> None:
        """Hand the disturbance on."""
        self._solver.disturb(d)

    def solve(self, x0: NDArray[np.float64], guess: NDArray[np.float64]) -> Plan:
        """Return a plan, or none; see :class:`~koopman_lab.mpc.solver.Solver`."""
        if self._left > 0:
            self._left -= 1
            states = np.tile(x0, (len(guess) + 1, 1))
            return Plan(guess, states, float("nan"), 0, False, "made to fail")
        return self._solver.solve(x0, guess)
