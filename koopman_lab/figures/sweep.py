"""How the smoothing window moves the fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv
from koopman_lab.koopman.sweep import STEPS, Entry, SweepRow, as_table


def draw_sweep(stem: Path, rows: Sequence[SweepRow], entries: Sequence[Entry]) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``.

    Parameters
    ----------
    stem
        Path without ending.
    rows
        From :func:`~koopman_lab.koopman.sweep.sweep`.
    entries
        Those of the matrices to show, each as its deviation from the nominal equations.
    """
    fitted = [row for row in rows if row.entries is not None]
    windows = [row.window for row in fitted]
    figure = new_figure(width=11.0, height=3.6)
    left, middle, right = figure.subplots(1, 3)
    for entry in entries:
        off = [abs((row.entries or {})[entry.name] / entry.nominal - 1.0) for row in fitted]
        left.plot(windows, np.maximum(off, np.finfo(float).eps), "o-", label=entry.name)
    left.set(title="entries of the matrices", ylabel="deviation, share of nominal")
    for name, label in (("one_step", "1 step"), ("multi_step", f"{STEPS} steps")):
        found = [getattr(row, name) for row in fitted]
        with_errors = [(w, e) for w, e in zip(windows, found, strict=True) if e is not None]
        at = [w for w, _ in with_errors]
        middle.plot(at, [1e3 * e.position_mean_m for _, e in with_errors], "o-", label=label)
        right.plot(at, [np.degrees(e.angle_mean_rad) for _, e in with_errors], "o-", label=label)
    middle.set(title="position, held-out runs", ylabel="mean error (mm)")
    right.set(title="orientation, held-out runs", ylabel="mean error (deg)")
    for axes in (left, middle, right):
        axes.set(xlabel="window (frames)", yscale="log")
        axes.grid(visible=True)
        if fitted:
            axes.legend(fontsize="small")
    save(figure, stem)
    write_csv(stem.with_suffix(".csv"), *as_table(rows))
