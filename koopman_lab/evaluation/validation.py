"""Models side by side on reference runs that none of them has seen (paper, section 5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from koopman_lab.data.reference_trajectories import ReferenceRuns
from koopman_lab.errors import DataError, ModelError
from koopman_lab.evaluation.metrics import (
    Errors,
    Predict,
    Starts,
    by_model,
    by_nominal,
    per_step,
    rolling_deviations,
)
from koopman_lab.evaluation.trajectory_starts import starts_along
from koopman_lab.geometry.planar import ORIGIN, Pose
from koopman_lab.predictors.predictor import LearnedModel

NOMINAL = "nominal"


@dataclass(frozen=True)
class ComparedPredictor:
    """Something that predicts, by the name of its model.

    ``dictionary`` is that of a model or, of one that has none, its name; None for the nominal
    equations. ``reprojection`` is None for whatever does not lift. ``marker_offset`` is the pose of
    the tracked frame in the frame whose poses it predicts.
    """

    model: str
    predict: Predict
    dictionary: str | None = None
    reprojection: bool | None = None
    marker_offset: Pose = ORIGIN

    @property
    def label(self) -> str:
        """Return what to call it where there is little room."""
        return self.model + (", no reprojection" if self.reprojection is False else "")


@dataclass(frozen=True)
class Validation:
    """Errors of one predictor on the runs of one session, of 1, 2, ... steps."""

    session: str
    shape: str
    runs: int
    model: str
    label: str
    dictionary: str | None
    reprojection: bool | None
    errors: Sequence[Errors | None]

    def __repr__(self) -> str:
        known = [e for e in self.errors if e is not None]
        means = ", ".join(
            f"{e.steps} ahead {1e3 * e.position_mean_m:.3g} mm {e.angle_mean_rad:.3g} rad"
            for e in known[:: max(len(known) - 1, 1)]
        )
        return f"Validation({self.label} on {self.runs} runs, {self.shape}: mean errors {means})"


def common_dt_s(models: Mapping[str, LearnedModel]) -> float:
    """Return the sampling time of all models.

    Raises
    ------
    DataError
        If it is not the same.
    """
    times = {model.dt_s for model in models.values()}
    if len(times) > 1:
        listing = ", ".join(f"{name} {model.dt_s:g} s" for name, model in models.items())
        raise DataError(
            f"models of different sampling times ({listing}) take different steps; "
            "validate them one by one"
        )
    return times.pop()


def require_robot(models: Mapping[str, LearnedModel], runs: ReferenceRuns) -> None:
    """Refuse models of another robot than the one that drove.

    Raises
    ------
    ModelError
        If there is one.
    """
    kind = runs.config.robot.kind
    for name, model in models.items():
        if model.robot.name != kind:
            raise ModelError(
                f"{runs.path}: runs of the {kind} robot, but the model {name} "
                f"({model.name}) is of the {model.robot.name} one; leave one of them out"
            )


def predictors(models: Mapping[str, LearnedModel]) -> list[ComparedPredictor]:
    """Return each model, with and without reprojection if it lifts, and the nominal equations.

    The nominal equations see the runs as the first model does.
    """
    learned = [
        ComparedPredictor(
            name,
            by_model(model, reproject=reproject is not False),
            model.name,
            reproject,
            model.marker_offset,
        )
        for name, model in models.items()
        for reproject in ((True, False) if model.lifts else (None,))
    ]
    first = next(iter(models.values()))
    nominal = by_nominal(first.robot, common_dt_s(models))
    return [*learned, ComparedPredictor(NOMINAL, nominal, marker_offset=first.marker_offset)]


def starts_by_offset(
    compared: Sequence[ComparedPredictor], runs: ReferenceRuns, steps: int, dt_s: float
) -> dict[Pose, Starts]:
    """Return what predictors start from, by their marker offsets."""
    rate_hz = runs.config.mocap.rate_hz
    offsets = dict.fromkeys(predictor.marker_offset for predictor in compared)
    return {o: starts_along(runs.trajectories(o), steps, dt_s, rate_hz) for o in offsets}


def validate(
    models: Mapping[str, LearnedModel], runs: ReferenceRuns, steps: int
) -> Iterator[Validation]:
    """Measure models by name on the runs of a session.

    Parameters
    ----------
    models
        At least one, all of the session's robot and of one sampling time.
    runs
        Reference runs of the session.
    steps
        How far ahead to predict, at least 1.

    Raises
    ------
    ModelError
        If a model is of another robot.
    DataError
        If the models differ in their sampling times, or no run is as long as that.
    """
    require_robot(models, runs)
    dt_s = common_dt_s(models)
    compared = predictors(models)
    starts = starts_by_offset(compared, runs, steps, dt_s)
    if not all(len(s.x0) for s in starts.values()):
        raise DataError(
            f"{runs.path}: no two states {dt_s:g} s apart in its runs; see whether the cameras "
            "saw the robot, and lower --window if it is wide"
        )
    for predictor in compared:
        yield Validation(
            str(runs.path),
            runs.shape,
            runs.count,
            predictor.model,
            predictor.label,
            predictor.dictionary,
            predictor.reprojection,
            per_step(
                rolling_deviations(predictor.predict, starts[predictor.marker_offset], runs.robot)
            ),
        )


COLUMNS = [
    *("session", "shape", "runs", "model", "dictionary", "reprojection"),
    *(field.name for field in fields(Errors)),
]


def as_table(validations: Sequence[Validation]) -> list[list[Any]]:
    """Return one line for each predictor, session and number of steps; see :data:`COLUMNS`."""
    return [
        [
            *(v.session, v.shape, v.runs, v.model, v.dictionary, v.reprojection),
            *asdict(errors).values(),
        ]
        for v in validations
        for errors in v.errors
        if errors is not None
    ]
