"""Figure of the motor loop's responses to set-points."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from koopman_lab.figures.canvas import new_figure, save


def draw_responses(stem: Path, responses: Mapping[str, NDArray[np.float64]]) -> None:
    """Write ``stem.pdf`` and ``stem.png``.

    Parameters
    ----------
    stem
        Path without ending.
    responses
        By name: rows of time (s), set-point v (m/s), true v (m/s), (T, 3).
    """
    figure = new_figure(width=4.0 * len(responses), height=3.2)
    axes = figure.subplots(1, len(responses), squeeze=False)[0]
    for ax, (name, rows) in zip(axes, responses.items(), strict=True):
        ax.plot(rows[:, 0], rows[:, 1], "--", color="tab:gray", label="set-point")
        ax.plot(rows[:, 0], rows[:, 2], color="tab:blue", label="robot")
        ax.set(title=name, xlabel="time (s)", ylabel="v (m/s)")
        ax.grid(visible=True)
    axes[0].legend()
    save(figure, stem)
