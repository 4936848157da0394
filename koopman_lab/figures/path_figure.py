"""Paths of parking runs, and their value functions over the same marks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.figures.canvas import new_figure, save

MARKS = 12
"""Number of marks, evenly spaced in time and the same in both plots, as in the paper's figures."""
ARROW_M = 0.05


class Curve(NamedTuple):
    """The path and the value function of one run.

    Attributes
    ----------
    label
        Name in the legend, which a single run does not have.
    time_s
        Time of each step (N,).
    poses
        Relative to the goal (N, 3): m, m, rad.
    value
        Value function of each step (N,).
    """

    label: str
    time_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    value: NDArray[np.float64]


def draw_paths(stem: Path, curves: Sequence[Curve], *, deviation: bool = False) -> None:
    """Write ``stem.pdf`` and ``stem.png``.

    Parameters
    ----------
    stem
        Path without ending.
    curves
        At least one run.
    deviation
        Whether |x2| is drawn as well, as for the paper's lab runs.
    """
    panels = 3 if deviation else 2
    figure = new_figure(width=4.5 * panels, height=4.0)
    plane, values, *aside = figure.subplots(1, panels)
    for number, (label, time_s, poses, value) in enumerate(curves):
        color, line = f"C{number}", ("-", "--", "-.", ":")[number % 4]
        marked = np.unique(np.linspace(0, len(time_s) - 1, MARKS).round().astype(int))
        plane.plot(poses[:, 0], poses[:, 1], line, color=color, label=label)
        plane.quiver(
            poses[marked, 0],
            poses[marked, 1],
            ARROW_M * np.cos(poses[marked, 2]),
            ARROW_M * np.sin(poses[marked, 2]),
            angles="xy",
            scale_units="xy",
            scale=1.0,
            color=color,
            width=0.006,
        )
        values.semilogy(time_s, np.maximum(value, np.finfo(float).tiny), line, color=color)
        values.semilogy(time_s[marked], value[marked], "o", color=color, markersize=4)
        for axes in aside:
            axes.semilogy(time_s, 1e3 * np.abs(poses[:, 1]), line, color=color)
    plane.plot(0.0, 0.0, "x", color="tab:red", markersize=10, markeredgewidth=2)
    plane.set(xlabel="$x_1$ (m)", ylabel="$x_2$ (m)", title="path, goal at the cross")
    plane.set_aspect("equal", adjustable="box")
    plane.grid(visible=True)
    if len(curves) > 1:
        plane.legend(fontsize="small")
    values.set(xlabel="time (s)", ylabel="value function", title="optimal cost")
    values.grid(visible=True)
    for axes in aside:
        axes.set(xlabel="time (s)", ylabel="$|x_2|$ (mm)", title="deviation sideways")
        axes.grid(visible=True)
    save(figure, stem)
