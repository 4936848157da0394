"""Empirical distribution functions of |x2| at the end, as in the paper (sections 4, 5.4 and 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv

SMALLEST_MM = 1e-6
"""What is smaller is drawn here: a logarithmic axis has no zero."""


def draw_distribution(
    stem: Path,
    panels: Mapping[str, Sequence[str]],
    deviations_mm: Mapping[str, NDArray[np.float64]],
) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``.

    Parameters
    ----------
    stem
        Path without ending.
    panels
        By title: the cases drawn in it.
    deviations_mm
        By case: |x2| of its runs, sorted; infinite for a run that failed.
    """
    figure = new_figure(width=1.0 + 4.5 * len(panels), height=4.2)
    lines: list[list[object]] = []
    for axes, (title, labels) in zip(
        figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True
    ):
        for number, label in enumerate(labels):
            final_mm = deviations_mm[label]
            share = np.arange(1, len(final_mm) + 1) / len(final_mm)
            known = np.isfinite(final_mm)
            axes.step(
                np.maximum(final_mm[known], SMALLEST_MM),
                share[known],
                where="post",
                label=label,
                color=f"C{number % 10}",
                linestyle=("-", "--")[number // 10 % 2],
                linewidth=1.2,
            )
            lines += [[label, x, y] for x, y in zip(final_mm.tolist(), share.tolist(), strict=True)]
        axes.set(
            title=title,
            xlabel="|x2| at the end (mm)",
            ylabel="share of the starts",
            xscale="log",
            ylim=(0.0, 1.02),
        )
        axes.grid(visible=True)
        axes.legend(fontsize="small")
    save(figure, stem)
    write_csv(stem.with_suffix(".csv"), ("case", "x2_mm", "share"), lines)
