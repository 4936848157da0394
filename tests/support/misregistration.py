"""Data sets as cameras would have given them whose frame, body or clock is set up otherwise."""

from dataclasses import replace

import numpy as np

POSITION_NOISE_M, ANGLE_NOISE_RAD = 0.0006, 0.00261
VELOCITY_NOISE = (0.005, 0.02)
"""Those of preset `harsh`; velocities smoothed over 40 frames, m/s and rad/s."""


def misregistered(
    dataset,
    turned_rad=0.0,
    heading_rad=0.0,
    scale=1.0,
    time_factor=1.0,
    moved=(0.0, 0.0),
    *,
    mirrored=False,
    clockwise=False,
):
    """Return the same motion seen otherwise.

    Positions are mirrored at the first axis, turned, scaled and moved; headings are negated if
    ``clockwise``, then turned as positions are, and by ``heading_rad`` more. Velocities are those
    that differences of these poses give. The sampling time is said to be so many times the true
    one.
    """
    c, s = np.cos(turned_rad), np.sin(turned_rad)
    linear = scale * np.array([[c, -s], [s, c]]) @ np.diag([1.0, -1.0 if mirrored else 1.0])
    sign = -1.0 if clockwise else 1.0

    def seen(x):
        changed = x.copy()
        changed[:, :2] = x[:, :2] @ linear.T + moved
        changed[:, 2] = sign * x[:, 2] + turned_rad + heading_rad
        if dataset.robot.speeds_at:
            v, omega = dataset.robot.speeds_at
            rate = (x[:, v] * np.array([np.cos(x[:, 2]), np.sin(x[:, 2])])).T @ linear.T
            ahead = np.array([np.cos(changed[:, 2]), np.sin(changed[:, 2])]).T
            changed[:, v], changed[:, omega] = np.sum(rate * ahead, axis=1), sign * x[:, omega]
        return changed

    return replace(
        dataset,
        X={i: seen(x) for i, x in dataset.X.items()},
        Y={i: seen(y) for i, y in dataset.Y.items()},
        dt_s=dataset.dt_s * time_factor,
    )


def noisy(dataset, seed=0):
    """Return a data set with the noise of preset `harsh` in states and successors."""
    rng = np.random.default_rng(seed)
    spread = np.full(dataset.robot.state_dim, POSITION_NOISE_M)
    spread[2] = ANGLE_NOISE_RAD
    spread[list(dataset.robot.speeds_at)] = VELOCITY_NOISE[: len(dataset.robot.speeds_at)]

    def disturbed(table):
        return {i: x + spread * rng.standard_normal(x.shape) for i, x in table.items()}

    return replace(dataset, X=disturbed(dataset.X), Y=disturbed(dataset.Y))


def exchanged_inputs(dataset, order):
    """Return the data set with the pairs of its basis inputs in another order, by index."""
    tables = {
        name: {i: getattr(dataset, name)[j] for i, j in order.items()}
        for name in ("X", "Y", "segments", "start_us")
    }
    return replace(dataset, **tables)


def back_in_time(dataset):
    """Return the data set with states and successors exchanged."""
    return replace(dataset, X=dataset.Y, Y=dataset.X)
