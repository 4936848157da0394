"""Our own back end: control-limited differential dynamic programming in compiled code.

An interior-point method begins every problem far inside the bounds and spends most of its
iterations on the way back. A plan shifted by one stage is nearly optimal already: here Newton's
method over the stages starts from it, with a small quadratic program in a box for each stage's
inputs (Tassa, Mansard and Todorov, ICRA 2014). All iterates are simulated, so each has no gaps and
a true value, and the value falls from one to the next.

It has no bounds of the speeds.
"""

from __future__ import annotations

import ctypes
import re
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from koopman_lab.mpc import rollout as rollouts
from koopman_lab.mpc.stage_costs import StageCost, cost_of
from koopman_lab.predictors.predictor import PredictionModel

Array = NDArray[np.float64]

TOLERANCE = 1e-7
"""Expected decrease of the value below which a plan counts as optimal."""


def source(model: PredictionModel, cost: StageCost, horizon: int) -> str:
    """Return C code of the solver, and of :func:`rollout.function`, for one shape of problem."""
    size, inputs = model.size, model.input_dim
    s, u, vx = ca.SX.sym("s", size), ca.SX.sym("u", inputs), ca.SX.sym("vx", size)
    of_model = ca.SX.sym("model", model.parameters.size)
    weights = ca.SX.sym("weights", cost.parameters.size)
    p, z = ca.vertcat(of_model, weights), ca.vertcat(s, u)
    following = model.step(s, u, of_model)
    stage = cost_of(model, cost, s, u, weights)
    end = cost_of(model, cost, s, ca.SX.zeros(inputs), weights)
    hessian, _ = ca.hessian(stage + ca.dot(vx, following), z)
    end_hessian, _ = ca.hessian(end, s)
    results = {
        "ddp_roll": ([s, u, p], [following, stage]),
        "ddp_expand": ([s, u, p, vx], [ca.jacobian(following, z), ca.gradient(stage, z), hessian]),
        "ddp_end": ([s, p], [end, ca.gradient(end, s), end_hessian]),
    }
    functions = [
        ca.Function(name, arguments, [ca.densify(part) for part in parts])
        for name, (arguments, parts) in results.items()
    ]
    generator = ca.CodeGenerator("program.c", {"with_header": False})
    for function in [*functions, rollouts.function(model, cost, horizon)]:
        generator.add(function)
    sizes = {"SIZE": size, "INPUTS": inputs, "HORIZON": horizon}
    for name in ("sz_arg", "sz_res", "sz_iw", "sz_w"):
        sizes[name.upper()] = max(getattr(function, name)() for function in functions)
    lines = [f"#define {name} {number}" for name, number in sizes.items()]
    return "\n".join([str(generator.dump()), *lines, _read("ddp.c")])


def _read(name: str) -> str:
    """Return the text of a file beside this one, with those it includes: libraries hang on all."""
    text = Path(__file__).with_name(name).read_text()
    return re.sub(r'#include "(\w+\.c)"', lambda line: _read(line[1]), text)


class Improver:
    """The compiled solver of one model, cost and horizon; one instance serves one thread.

    Parameters
    ----------
    library
        The compiled code of :func:`source`.
    model, cost
        Give the numbers of the problem; shapes are those that the library was made for.
    u_max
        Largest magnitudes of the inputs (m,).
    most_iterations
        Largest number of iterations of a call.
    """

    def __init__(
        self,
        library: Path,
        model: PredictionModel,
        cost: StageCost,
        u_max: Array,
        most_iterations: int,
    ) -> None:
        loaded = ctypes.CDLL(str(library))
        pointer = ctypes.c_void_p
        self._solve = loaded.ddp_solve
        self._solve.argtypes = [*[pointer] * 4, ctypes.c_double, ctypes.c_int, pointer]
        self._work = np.zeros(loaded.ddp_work_size() // 8 + 1)
        self._numbers = np.concatenate([model.parameters, cost.parameters])
        self._disturbed = rollouts.disturbance_slice(model)
        self._u_max = np.array(u_max, float)
        self._most_iterations = most_iterations

    def disturb(self, d: Array) -> None:
        """Let the model predict with other last parameters (its ``disturbance_dim``,)."""
        self._numbers[self._disturbed] = d

    def __call__(self, s0: Array, guess: Array) -> tuple[Array, int]:
        """Return inputs (H, m) no worse than the guess's and the number of iterations.

        The number is negative if the inputs are not optimal yet.

        Parameters
        ----------
        s0
            What the model propagates, at the start, (S,).
        guess
            Inputs (H, m).
        """
        inputs = np.clip(np.ascontiguousarray(guess, float), -self._u_max, self._u_max)
        start = np.ascontiguousarray(s0, float)
        arrays = (self._work, start, self._numbers, self._u_max)
        addresses = [array.ctypes.data for array in arrays]
        count: int = self._solve(*addresses, TOLERANCE, self._most_iterations, inputs.ctypes.data)
        return inputs, count
