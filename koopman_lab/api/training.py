"""Trains a model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from koopman_lab.api.arguments import FilePath
from koopman_lab.api.learned_model import Model
from koopman_lab.config.load import load_config
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.source import Source, open_source
from koopman_lab.evaluation.judged_training import JudgedTrainer
from koopman_lab.koopman.combination import PAPER, Combination
from koopman_lab.koopman.lifted_samples import Estimator
from koopman_lab.koopman.training_report import Method


def train(
    *sources: DataSet | FilePath,
    dictionary: str | Sequence[str] | None = None,
    predictor: str = "edmd",
    estimator: Estimator = "plain",
    ridge: float = 0.0,
    symmetric: bool = False,
    combination: Combination = PAPER,
) -> Model:
    """Learn a model of a robot from one data set or several, as `klab train` does.

    Data and model are judged, and the model keeps that: :attr:`Model.verdict` says it, and a
    controller refuses a model that would drive the wrong way.

    Parameters
    ----------
    sources
        Data sets, or what :func:`koopman_lab.read_data` reads; of files, one at a time is in
        memory.
    dictionary
        Name of a dictionary, or expressions of the observables: as a sequence, or with commas
        between them. None for the one that the session's configuration says; for a data set, that
        of the robot's defaults.
    predictor
        What is learned, a row of the table of predictors (:mod:`koopman_lab.predictors.table`).
    estimator
        ``plain`` for least squares, ``iv`` for instrumental variables, which have no bias by
        camera noise.
    ridge
        Weight of a pull towards the identity.
    symmetric
        Whether only models are fitted that planar motions leave as they are.
    combination
        How inputs are combined: ``paper`` for matrices, ``generator`` for their generators.

    Raises
    ------
    LabError
        If a source cannot be used, or together they do not excite the dictionary.
    """
    observables = (
        dictionary if dictionary is None or isinstance(dictionary, str) else ", ".join(dictionary)
    )
    method = Method(estimator, ridge, symmetric, combination)
    trainer = JudgedTrainer(predictor, observables, method)
    for source in sources:
        trainer.add(_opened(source))
    return Model(trainer.result().model)


def _opened(source: DataSet | FilePath) -> Source:
    if not isinstance(source, DataSet):
        return open_source(Path(source))
    default = load_config(robot=source.robot_kind).model.dictionary
    return Source(source, default, Path("the data set"), Path(), None)
