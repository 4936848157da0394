"""The one table of predictors that are learned: how each is trained, read and planned with.

A model file says whose it is (`koopman_lab.koopman.model_file`); whoever needs a model asks
:func:`load_model` and does not know which one it gets.

Another package adds one by an entry point of the group ``koopman_lab.predictors``, whose name is
what a person types and model files say, and whose value a :class:`Predictor`::

    [project.entry-points."koopman_lab.predictors"]
    resnet = "my_package.row:RESNET"

    # my_package/row.py, which imports nothing heavy
    RESNET = Predictor("resnet", "my_package.net:load", "my_package.net:plan", "my_package.fit:Fit")

`klab train --predictor resnet` learns a model, and every command that takes a model file takes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from koopman_lab.config.controller import Controller
from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import ModelError
from koopman_lab.koopman.model_file import EDMD, ModelFile, read_model_file
from koopman_lab.registry import Registry

if TYPE_CHECKING:
    from koopman_lab.koopman.training_report import Method
    from koopman_lab.predictors.predictor import LearnedModel, PredictionModel

PACKAGE = "package"
"""Key of a model file's header that names the package of its predictor."""


class Report(Protocol):
    """What training brought, besides the model."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""


class Trainer(Protocol):
    """Learns a model from data sets, taken in one after the other."""

    def add(self, dataset: DataSet) -> None:
        """Take in a data set."""

    def result(self) -> tuple[LearnedModel, Report]:
        """Return the model, and what a person should know of it."""


@dataclass(frozen=True)
class Predictor:
    """One predictor.

    Attributes
    ----------
    name
        As in ``--predictor`` and in model files.
    load
        Maps a :class:`~koopman_lab.koopman.model_file.ModelFile` to its
        :class:`~koopman_lab.predictors.predictor.LearnedModel`. Each of these is a callable, or
        where it is, as ``module:attribute``.
    plan
        Maps a model to the :class:`~koopman_lab.predictors.predictor.PredictionModel` that a
        controller plans with.
    train
        Maps the name of the dictionary that a person or the configuration names, and the
        :class:`~koopman_lab.koopman.training_report.Method`, to a :class:`Trainer`, which leaves
        alone what it has no use for.
    """

    name: str
    load: str | Callable[[ModelFile], LearnedModel]
    plan: str | Callable[[Any], PredictionModel]
    train: str | Callable[[str, Method], Trainer]


PREDICTORS: Registry[Predictor] = Registry(
    "predictor",
    "koopman_lab.predictors",
    Predictor,
    {
        EDMD: Predictor(
            EDMD,
            "koopman_lab.koopman.bilinear_model:BilinearModel.from_file",
            "koopman_lab.predictors.bilinear_edmd:KoopmanPrediction",
            "koopman_lab.koopman.trainer:Trainer",
        ),
    },
)


def load_model(path: Path) -> LearnedModel:
    """Read the model file of any predictor.

    Raises
    ------
    ModelError
        If the file is missing, damaged, no model, of another version, of a predictor that is not
        installed, or of what the predictor does not know.
    PluginError
        If the predictor is another package's, and cannot be used.
    """
    return model_of(read_model_file(path))


def model_of(file: ModelFile) -> LearnedModel:
    """Return the model that a file holds.

    Raises
    ------
    ModelError
        If it is of a predictor that is not installed, or of what the predictor does not know.
    PluginError
        If the predictor is another package's, and cannot be used.
    """
    name = file.header["predictor"]
    if name not in PREDICTORS:
        package = file.header.get(PACKAGE)
        where = f"; install the package {package}" if package else ""
        raise ModelError(
            f"{file.path}: a model of the predictor {name!r}, which is not installed{where}; "
            f"known: {', '.join(PREDICTORS.names())}"
        )
    model: LearnedModel = PREDICTORS.load(name, PREDICTORS.get(name).load)(file)
    return model


def file_header(name: str) -> dict[str, str]:
    """Return what the header of a model file says of its predictor.

    A model of another package saves itself with it, by
    :func:`~koopman_lab.koopman.model_file.write_model_file`, so that where the package is not
    installed it is named.
    """
    package = PREDICTORS.package(name)
    return {"predictor": name} | ({PACKAGE: package} if package else {})


def trainer_of(name: str, observables: str, method: Method) -> Trainer:
    """Return what learns a model of a predictor.

    Raises
    ------
    ConfigError
        If there is no such predictor.
    PluginError
        If it is another package's, and cannot be used.
    """
    trainer: Trainer = PREDICTORS.load(name, PREDICTORS.get(name).train)(observables, method)
    return trainer


def prediction(model: LearnedModel) -> PredictionModel:
    """Return what a controller plans with, of a model.

    Raises
    ------
    PluginError
        If its predictor is another package's, and cannot be used.
    """
    name = model.predictor
    planned: PredictionModel = PREDICTORS.load(name, PREDICTORS.get(name).plan)(model)
    return planned


def prediction_of(model: LearnedModel, settings: Controller) -> PredictionModel:
    """Return what a controller plans with: the model, or the nominal equations in its place."""
    if settings.predict == "nominal":
        from koopman_lab.predictors.nominal import NominalPrediction

        return NominalPrediction(model.robot.name, settings.dt_s, model.marker_offset)
    return prediction(model)


def load_prediction(path: Path, settings: Controller) -> PredictionModel:
    """Return what a controller plans with, from a model file; see :func:`prediction_of`.

    Raises
    ------
    ModelError, PluginError
        See :func:`load_model`.
    """
    return prediction_of(load_model(path), settings)
