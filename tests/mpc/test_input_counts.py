"""Robots with one input and with four, beside the general solvers (two: test_ocp)."""

import numpy as np
import pytest

from koopman_lab.mpc.solver import make_solver
from koopman_lab.mpc.stage_costs import Quadratic
from koopman_lab.predictors.nominal import NominalPrediction
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.robot_type import Quantity, RobotType
from koopman_lab.robots.table import ROBOTS

HORIZON, DT_S = 6, 0.1


def robot(name, body_velocities):
    """Return a robot whose inputs make the velocities of its body, linearly: a matrix (3, m)."""

    def components(x, u, dt_s, m):
        ahead, aside, omega = (
            sum(float(weight) * value for weight, value in zip(row, u, strict=True))
            for row in body_velocities
        )
        angle = x[2] + 0.5 * dt_s * omega
        c, s = m.cos(angle), m.sin(angle)
        return [
            x[0] + dt_s * (c * ahead - s * aside),
            x[1] + dt_s * (s * ahead + c * aside),
            x[2] + dt_s * omega,
        ]

    count = body_velocities.shape[1]
    return RobotType(
        name=name,
        title=name,
        states=KINEMATIC.states,
        inputs=tuple(Quantity(f"wheel{k}", "rad/s") for k in range(count)),
        components=components,
        drifts=False,
        sideways=(),
        speeds_at=(),
        braking=lambda _x, u_max, _dt_s, steps: np.zeros((steps, len(u_max))),
        effort=np.ones,
    )


RAIL = robot("rail", np.array([[1.0], [0.0], [0.2]]))
MECANUM = robot("mecanum", 0.25 * np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-2, 2, -2, 2.0]]))
"""Four wheels for three velocities: any input may be exchanged for another."""


@pytest.fixture(params=[RAIL, MECANUM], ids=lambda kind: kind.name)
def kind(request):
    ROBOTS.register(request.param.name, request.param)
    yield request.param
    ROBOTS.unregister(request.param.name)


def test_our_solver_fatrop_and_ipopt_agree(kind):
    m = kind.input_dim
    model = NominalPrediction(kind.name, DT_S)
    cost = Quadratic((1.0, 1.0, 0.1), tuple(np.linspace(0.02, 0.05, m)))
    u_max = tuple(np.linspace(0.8, 1.2, m))
    solvers = {
        name: make_solver(model, cost, HORIZON, u_max, name, 300)
        for name in ("ddp", "fatrop", "ipopt")
    }
    assert solvers["ddp"].description == "ddp, compiled"
    rng = np.random.default_rng(1)
    bounded = 0
    for x0 in rng.uniform(-1.0, 1.0, (5, 3)) * [1.0, 0.5, 0.5]:
        guess = np.full((HORIZON, m), 0.1)
        plans = {name: solver.solve(x0, guess) for name, solver in solvers.items()}
        for plan in plans.values():
            assert plan.ok
            assert plan.inputs.shape == (HORIZON, m)
            assert plan.value == pytest.approx(plans["ipopt"].value, rel=1e-6)
        bounded += np.count_nonzero(np.abs(plans["ddp"].inputs) == u_max)
    assert bounded
