"""Figure of how the smoothing window moves the fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from koopman_lab.evaluation.window_sweep import STEPS, Entry, SweepRow, as_table
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv

STYLES = ("o-", "s--")
"""Styles of the estimators' lines."""


def draw_sweep(stem: Path, rows: Sequence[SweepRow], entries: Sequence[Entry]) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``.

    Parameters
    ----------
    stem
        Path without ending.
    rows
        From :func:`~koopman_lab.evaluation.window_sweep.sweep`.
    entries
        Those of the matrices to show, each as its deviation from the nominal equations.
    """
    fitted = [row for row in rows if row.entries is not None]
    estimators = list(dict.fromkeys(row.estimator for row in fitted))
    figure = new_figure(width=11.0, height=3.6)
    left, middle, right = figure.subplots(1, 3)
    for estimator, style in zip(estimators, STYLES, strict=False):
        estimator_rows = [row for row in fitted if row.estimator == estimator]
        suffix = "" if len(estimators) == 1 else f", {estimator}"
        windows = [row.window for row in estimator_rows]
        for number, entry in enumerate(entries):
            relative_errors = [
                abs((row.entries or {})[entry.name] / entry.nominal - 1.0) for row in estimator_rows
            ]
            relative_errors = np.maximum(relative_errors, np.finfo(float).eps).tolist()
            left.plot(
                windows, relative_errors, style, color=f"C{number}", label=f"{entry.name}{suffix}"
            )
        for number, (name, label) in enumerate(
            (("one_step", "1 step"), ("multi_step", f"{STEPS} steps"))
        ):
            known = [(row.window, getattr(row, name)) for row in estimator_rows]
            known_windows = [w for w, e in known if e is not None]
            known_errors = [e for _, e in known if e is not None]
            with_label = {"color": f"C{number}", "label": f"{label}{suffix}"}
            middle.plot(
                known_windows, [1e3 * e.position_mean_m for e in known_errors], style, **with_label
            )
            right.plot(
                known_windows,
                [np.degrees(e.angle_mean_rad) for e in known_errors],
                style,
                **with_label,
            )
    left.set(title="entries of the matrices", ylabel="deviation, share of nominal")
    middle.set(title="position, held-out runs", ylabel="mean error (mm)")
    right.set(title="orientation, held-out runs", ylabel="mean error (deg)")
    for axes in (left, middle, right):
        axes.set(xlabel="window (frames)", yscale="log")
        axes.grid(visible=True)
        if fitted:
            axes.legend(fontsize="small")
    save(figure, stem)
    write_csv(stem.with_suffix(".csv"), *as_table(rows))
