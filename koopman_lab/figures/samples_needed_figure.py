"""Figure of how many samples a fit needs: its errors against their number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from koopman_lab.evaluation.samples_needed import STEPS, NeededRow, as_table
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv


def draw_needed(stem: Path, rows: Sequence[NeededRow]) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``.

    Parameters
    ----------
    stem
        Path without ending.
    rows
        From :func:`~koopman_lab.evaluation.samples_needed.errors_by_count`.
    """
    figure = new_figure(width=9.0, height=3.6)
    left, right = figure.subplots(1, 2)
    for number, method in enumerate(dict.fromkeys(row.method for row in rows)):
        method_rows = [row for row in rows if row.method == method]
        for axes, factor, name in ((left, 1e3, "position_m"), (right, 180 / np.pi, "angle_rad")):
            known = [(row.count, getattr(row, name)) for row in method_rows if getattr(row, name)]
            if not known:
                continue
            counts = [count for count, _ in known]
            low, middle, high = factor * np.array([band for _, band in known]).T
            axes.plot(counts, middle, "o-", color=f"C{number}", label=method, markersize=3)
            axes.fill_between(counts, low, high, color=f"C{number}", alpha=0.2, linewidth=0)
    for axes, what, unit in ((left, "position", "mm"), (right, "orientation", "deg")):
        axes.set(
            title=f"{what}, held-out runs",
            xlabel="samples for each basis input",
            ylabel=f"mean error after {STEPS} steps ({unit})",
            xscale="log",
            yscale="log",
        )
        axes.grid(visible=True)
        if axes.lines:
            axes.legend(fontsize="small")
    save(figure, stem)
    write_csv(stem.with_suffix(".csv"), *as_table(rows))
