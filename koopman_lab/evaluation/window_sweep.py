"""How the smoothing window moves the fit (paper, section 5.2 and its figure of samples).

The window decides the entries that integrate: an angle grows by omega dt, and what noise in omega
takes from that entry compounds over the horizon.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import DataError
from koopman_lab.evaluation.heldout import errors, held_out_runs, split
from koopman_lab.evaluation.metrics import Errors
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.lifted_samples import Estimator
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.robots.table import ROBOTS, robot_type

STEPS = 20
"""The paper's horizon of the multi-step errors."""


@dataclass(frozen=True)
class Entry:
    """An entry of M_i that the nominal equations know: the row's observable per the column's."""

    basis_index: int
    row: str
    column: str
    nominal: float

    @property
    def name(self) -> str:
        """Return how it is called, for example ``M_0[omega,omega]``."""
        return f"M_{self.basis_index}[{self.row},{self.column}]"


@dataclass(frozen=True)
class SweepRow:
    """The fit with one window and estimator.

    ``entries`` by name; ``constant_residual`` is how far least squares was from the row of the
    constant, ``condition`` that of the worst basis input, ``one_step`` and ``multi_step`` the
    errors on held-out runs. ``refused`` says why there is no fit, and then the rest is None.
    """

    window: int
    pairs: int
    estimator: Estimator = "plain"
    refused: str | None = None
    entries: dict[str, float] | None = None
    constant_residual: float | None = None
    condition: float | None = None
    one_step: Errors | None = None
    multi_step: Errors | None = None


def known_entries(config: LabConfig, observables: Sequence[str]) -> list[Entry]:
    """Return the entries to look at that a dictionary with these observables has."""
    dt_s, inputs = config.processing.dt_s, config.sampler.indexed_inputs
    robot = robot_type(config.robot.kind)
    v, omega = (robot.state_names[index] for index in robot.speeds_at)
    rest = np.zeros(robot.state_dim)
    entries = [
        Entry(0, v, v, 1.0),
        Entry(0, omega, omega, 1.0),
        Entry(0, "theta", omega, dt_s),
        *(
            Entry(
                i, robot.state_names[index], "1", float(robot.step(rest, np.array(u), dt_s)[index])
            )
            for i, u in inputs.items()
            for index in robot.speeds_at
            if i
        ),
    ]
    return [e for e in entries if e.row in observables and e.column in observables and e.nominal]


def sweep(
    log: SessionLog,
    windows: Sequence[int],
    dictionary: str,
    estimators: Sequence[Estimator] = ("plain",),
) -> Iterator[SweepRow]:
    """Fit a session with one window after the other, with each estimator.

    All models are measured on the same held-out runs, smoothed with the session's own window, so
    that the errors differ by the model alone.

    Parameters
    ----------
    log
        A calibration session of a robot whose state holds its speeds.
    windows
        Lengths of the window in frames.
    dictionary
        Name of the dictionary.
    estimators
        Estimators of :mod:`koopman_lab.koopman.lifted_samples`.

    Raises
    ------
    LabError
        If the session cannot be used, or is of a robot whose states are the pose alone.
    """
    config = log.config()
    if not robot_type(config.robot.kind).speeds_at:
        kinds_with_speeds = " or ".join(robot.name for robot in ROBOTS if robot.speeds_at)
        raise DataError(
            f"{log.path}: the {config.robot.kind} robot has no velocities among its states, so "
            "no window changes its fit; give a session of "
            f"`klab calibrate --robot {kinds_with_speeds}`"
        )
    full = DataSet.from_log(log, config)
    runs = held_out_runs(full)
    _, held_out = split(full, runs)
    for window in windows:
        dataset = DataSet.from_log(log, config, window=window)
        pairs = sum(map(len, dataset.X.values()))
        training = split(dataset, runs)[0]
        for estimator in estimators:
            try:
                model, report = train(training, dictionary, Method(estimator))
            except DataError as error:
                yield SweepRow(window, pairs, estimator, refused=str(error))
                continue
            yield SweepRow(
                window,
                pairs,
                estimator,
                None,
                _values(model, known_entries(config, model.dictionary.names)),
                max(b.constant_residual for b in report.bases),
                max(b.excitation.condition for b in report.bases if b.excitation),
                errors(model, held_out, 1),
                errors(model, held_out, STEPS),
            )


def _values(model: BilinearModel, entries: Sequence[Entry]) -> dict[str, float]:
    names = model.dictionary.names
    return {
        e.name: float(model.matrices[e.basis_index][names.index(e.row), names.index(e.column)])
        for e in entries
    }


def as_table(rows: Sequence[SweepRow]) -> tuple[list[str], list[list[Any]]]:
    """Return column names and one line a fit, None where there is no number."""
    entries = next((list(row.entries) for row in rows if row.entries), [])
    measures = [name for name in Errors.__dataclass_fields__ if name not in ("steps", "starts")]
    columns = ["window", "pairs", "estimator", *entries, "constant_residual", "condition"]
    columns += [f"{name}_1_step" for name in measures]
    columns += [f"{name}_{STEPS}_steps" for name in measures]
    lines = [
        [
            row.window,
            row.pairs,
            row.estimator,
            *((row.entries or {}).get(name) for name in entries),
            row.constant_residual,
            row.condition,
            *(getattr(row.one_step, name, None) for name in measures),
            *(getattr(row.multi_step, name, None) for name in measures),
            row.refused,
        ]
        for row in rows
    ]
    return [*columns, "refused"], lines
