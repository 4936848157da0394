"""Measures models on reference runs that they have not seen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from koopman_lab.api.arguments import FilePath
from koopman_lab.api.learned_model import Model, as_model
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.reference_trajectories import reference_runs
from koopman_lab.errors import ArgumentError
from koopman_lab.evaluation.validation import Validation
from koopman_lab.evaluation.validation import validate as measure


def validate(
    models: Model | FilePath | Mapping[str, Model | FilePath],
    reference: FilePath,
    *,
    steps: int = 20,
    window: int | None = None,
    salvage: bool = False,
) -> list[Validation]:
    """Measure how well models predict reference runs (paper, section 5.3), as `klab validate` does.

    Each model is measured with and without reprojection if it lifts, and the nominal equations
    beside them.

    Parameters
    ----------
    models
        A model or its file; or several, by the names that figures show.
    reference
        Folder or log of a session that `klab reference` recorded.
    steps
        How many sampling times ahead to predict.
    window
        Smoothing window in camera frames, in place of the session's.
    salvage
        Pass over what is damaged in the log.

    Raises
    ------
    ArgumentError
        If ``steps`` is less than 1, or there is no model.
    LabError
        If a file cannot be read, or the models do not fit the runs or each other.
    """
    if steps < 1:
        raise ArgumentError(f"steps: {steps}, expected at least 1")
    named = dict(models) if isinstance(models, Mapping) else {"": models}
    if not named:
        raise ArgumentError("models: 0 of them, expected at least 1")
    loaded = {name: as_model(model) for name, model in named.items()}
    learned = {name or model.name: model.learned for name, model in loaded.items()}
    runs = reference_runs(SessionLog(Path(reference), salvage=salvage), window)
    return list(measure(learned, runs, steps))
