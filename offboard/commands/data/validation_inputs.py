"""Reads the models and the reference runs that a person lists together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from koopman_lab.errors import DataError
from offboard.terminal.output import err, show_passed_over

if TYPE_CHECKING:
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.data.reference_trajectories import ReferenceRuns
    from koopman_lab.predictors.predictor import LearnedModel


class ValidationInputs(NamedTuple):
    """Models by name, and the runs of each session; all of one robot and one sampling time."""

    models: dict[str, LearnedModel]
    sessions: list[ReferenceRuns]
    logs: list[SessionLog]

    def show_passed_over(self) -> None:
        """Say what of the logs was passed over, and which frames cannot show the robot."""
        for log in self.logs:
            show_passed_over(log.passed_over)
        for runs in self.sessions:
            wrong = ", ".join(f"{count} {fault}" for fault, count in runs.left_out.items() if count)
            if wrong:
                err.print(f"{runs.path}: left out frames that cannot show the robot: {wrong}")


def models_and_runs(
    paths: Sequence[Path], window: int | None, *, salvage: bool
) -> ValidationInputs:
    """Read models (.npz) and the sessions of reference runs (everything else).

    Raises
    ------
    LabError
        If there is not at least one of both, one cannot be read, or they do not fit together.
    """
    from koopman_lab.data.decode import SessionLog
    from koopman_lab.data.reference_trajectories import reference_runs
    from koopman_lab.data.source import ENDING
    from koopman_lab.evaluation.validation import common_dt_s, require_robot
    from koopman_lab.predictors.table import load_model

    files = list(dict.fromkeys(path for path in paths if path.suffix == ENDING))
    others = list(dict.fromkeys(path for path in paths if path.suffix != ENDING))
    if not files or not others:
        missing = "model (a .npz file of `klab train`)"
        if files:
            missing = "reference run (a folder or log of `klab reference`)"
        raise DataError(f"{', '.join(map(str, paths))}: no {missing} among them; name at least one")
    names = [path.stem for path in files]
    models = {
        path.stem if names.count(path.stem) == 1 else str(path): load_model(path) for path in files
    }
    common_dt_s(models)
    logs = [SessionLog(path, salvage=salvage) for path in others]
    sessions = [reference_runs(log, window) for log in logs]
    for runs in sessions:
        require_robot(models, runs)
    return ValidationInputs(models, sessions, logs)
