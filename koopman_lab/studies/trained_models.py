"""Models that a study trains itself: from part of the data, or in different ways."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import NamedTuple

import numpy as np

from koopman_lab.data.dataset import DataSet
from koopman_lab.errors import DataError, LabError
from koopman_lab.evaluation.heldout import select_pairs
from koopman_lab.evaluation.samples_needed import draw
from koopman_lab.koopman.trainer import train
from koopman_lab.koopman.training_report import Method
from koopman_lab.predictors.table import load_model

COUNTS = (5, 10, 50, 100, 200, 500, 1000, 2000)
"""Samples for each basis input, section 6 of the paper; besides them, all."""


class Recipe(NamedTuple):
    """How a model is made: so many samples for each basis input (None for all), and a method."""

    samples: int | None = None
    method: Method = Method()


class Trained(NamedTuple):
    """What a model's file holds, or why there is none."""

    content: bytes
    refused: str


def by_count() -> dict[str, Recipe]:
    """Return the recipes of section 6 by label."""
    return {f"d{count}": Recipe(count) for count in COUNTS} | {"all": Recipe()}


def drawn(dataset: DataSet, count: int, seed: int) -> DataSet:
    """Return the data set with so many samples for each basis input, drawn across its runs.

    Raises
    ------
    DataError
        If there are not so many.
    """
    rng, chosen = np.random.default_rng([seed, count]), {}
    for index, segments in sorted(dataset.segments.items()):
        if len(segments) < count:
            raise DataError(f"basis input {index}: {count} samples wanted, {len(segments)} there")
        chosen[index] = np.zeros(len(segments), bool)
        chosen[index][draw(segments, count, rng)] = True
    return select_pairs(dataset, chosen)


def trained(
    file: Path, recipe: Recipe, dataset: DataSet, dictionary: str, seed: int, *, keep: bool
) -> Trained:
    """Train a model and leave it in ``file``; where it cannot be trained, say why.

    Parameters
    ----------
    file
        File of the model.
    recipe
        How the model is made.
    dataset
        The data that the model is made of.
    dictionary
        Name or expressions of the dictionary.
    seed
        Seed of the draw of samples.
    keep
        Take the file as it is if it is there: that of an interrupted study.
    """
    if not (keep and _is_whole(file)):
        try:
            count = recipe.samples
            part = dataset if count is None else drawn(dataset, count, seed)
            model, _ = train(part, dictionary, recipe.method)
        except LabError as error:
            return Trained(b"", str(error))
        model.save(file)
    return Trained(file.read_bytes(), "")


def _is_whole(file: Path) -> bool:
    """Return whether a model is there and as it was saved; of a damaged one a warning is logged."""
    try:
        load_model(file)
    except LabError as error:
        if file.exists():
            logging.getLogger(__name__).warning("%s; it is trained again", error)
        return False
    return True
