"""Reference runs of a robot that obeys the nominal equations exactly, seen by exact cameras."""

import numpy as np

from koopman_lab.data.reference_trajectories import Trajectory
from koopman_lab.robots.table import robot_type

DT_S, RATE_HZ, FRAME_US = 0.05, 240.0, 50_000 / 12


def run(kind="dynamic", steps=40, offset_us=0, seed=0, number=0, change=None):
    """Return the trajectory of the nominal robot under inputs that change in every step.

    The camera's frames begin ``offset_us`` after the first command; ``change`` keeps the input
    for so many steps.
    """
    rng, model = np.random.default_rng(seed), robot_type(kind)
    largest = np.array([0.2, 0.8] if model.input_dim == 2 else [0.2] * model.input_dim)
    inputs = rng.uniform(-largest, largest, (steps, model.input_dim))
    inputs = np.repeat(inputs, change or 1, axis=0)
    start_us = 1_700_000_000_000_000
    times = np.rint(offset_us + FRAME_US * np.arange(12 * len(inputs))).astype(np.int64)
    knots = [rng.uniform(-0.4, 0.4, model.state_dim)]
    for u in inputs:
        knots.append(model.step(knots[-1], u, DT_S))
    held = np.minimum(times // 50_000, len(inputs) - 1)
    since_s = (times - 50_000 * held) * 1e-6
    x = [model.step(knots[k], inputs[k], t) for k, t in zip(held, since_s, strict=True)]
    command_us = start_us + 50_000 * np.arange(len(inputs))
    end_us = start_us + 50_000 * len(inputs)
    return Trajectory(number, start_us, end_us, start_us + times, np.array(x), command_us, inputs)
