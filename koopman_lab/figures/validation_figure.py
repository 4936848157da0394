"""Figure of models' errors against how far ahead they predict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from koopman_lab.evaluation.validation import COLUMNS, NOMINAL, Validation, as_table
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv

MEASURES = (
    ("position_mean_m", 1e3, "mean position error (mm)"),
    ("position_max_m", 1e3, "largest position error (mm)"),
    ("angle_mean_rad", 180.0 / np.pi, "mean angle error (deg)"),
    ("angle_max_rad", 180.0 / np.pi, "largest angle error (deg)"),
)


def draw_validation(stem: Path, validations: Sequence[Validation]) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as ``stem.csv``; a row each session.

    Parameters
    ----------
    stem
        Path without ending.
    validations
        From :func:`~koopman_lab.evaluation.validation.validate`.
    """
    sessions = list(dict.fromkeys(v.session for v in validations))
    models = [m for m in dict.fromkeys(v.model for v in validations) if m != NOMINAL]
    colours = {NOMINAL: "black"} | {m: f"C{k}" for k, m in enumerate(models)}
    figure = new_figure(width=13.0, height=3.2 * len(sessions) + 0.6)
    rows = figure.subplots(len(sessions), len(MEASURES), squeeze=False)
    for row, session in zip(rows, sessions, strict=True):
        for axes, (name, factor, label) in zip(row, MEASURES, strict=True):
            for v in (v for v in validations if v.session == session):
                known = [e for e in v.errors if e is not None]
                axes.plot(
                    [e.steps for e in known],
                    [factor * getattr(e, name) for e in known],
                    "--" if v.reprojection is False else "-",
                    color=colours[v.model],
                    label=v.label,
                )
            shape = next(v.shape for v in validations if v.session == session)
            axes.set(xlabel=f"steps ahead ({shape})", ylabel=label, yscale="log")
            axes.grid(visible=True)
    handles, labels = rows[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, fontsize="small")
    save(figure, stem)
    write_csv(stem.with_suffix(".csv"), COLUMNS, as_table(validations))
