"""Exactly integrated data sets; nothing but the nominal equations."""

import numpy as np

from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.robots.table import robot_type


def ideal_dataset(kind, segments=8, steps=40, dt_s=0.05, seed=0, noise=0.0):
    """Return segments under each basis input of the robot's defaults, sampled every ``dt_s``."""
    rng, model = np.random.default_rng(seed), robot_type(kind)
    inputs = load_config(robot=kind).sampler.indexed_inputs
    x_all, y_all, ids, starts = {}, {}, {}, {}
    for index, u in inputs.items():
        low = [0.0, -0.75, -np.pi, 0.0, -1.0][: model.state_dim]
        high = [1.5, 0.75, np.pi, 0.4, 1.0][: model.state_dim]
        x = rng.uniform(low, high, (segments, model.state_dim))
        path = [x]
        for _ in range(steps):
            path.append(model.step(path[-1], np.broadcast_to(u, (segments, len(u))), dt_s))
        path = np.stack(path, axis=1) + noise * rng.normal(size=(segments, steps + 1, x.shape[1]))
        # Copies: of a single segment both would be views of the same states.
        before = path[:, :-1].reshape(-1, x.shape[1]).copy()
        after = path[:, 1:].reshape(-1, x.shape[1]).copy()
        turns = 2 * np.pi * np.floor((before[:, 2] + np.pi) / (2 * np.pi))
        before[:, 2] -= turns
        after[:, 2] -= turns
        x_all[index], y_all[index] = before, after
        ids[index] = np.repeat(np.arange(segments), steps)
        starts[index] = np.tile(np.arange(steps) * 50_000, segments)
    return DataSet(
        X=x_all,
        Y=y_all,
        segments=ids,
        start_us=starts,
        basis_inputs={i: np.array(u) for i, u in inputs.items()},
        dt_s=dt_s,
        robot_kind=kind,
        metadata={},
    )
