"""The verdict on a data set: whether its pairs can be those of the robot under its basis inputs.

Pairs alone are asked, so that a data set of anybody is judged like our own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from koopman_lab.data.dataset import DataSet
from koopman_lab.evaluation.likely_causes import (
    BACKWARDS,
    EXCHANGED_AXES,
    MIRRORED_AXIS,
    MIRRORED_FRAME,
    MIRRORED_HEADING,
    causes,
)
from koopman_lab.evaluation.motion_reasons import data_reasons
from koopman_lab.evaluation.nominal_motion import NominalMotion, motion_of_data
from koopman_lab.evaluation.plausibility import Reason, Verdict, verdict
from koopman_lab.koopman.dictionary import Dictionary
from koopman_lab.koopman.excitation import Excitation, excitation, remedy
from koopman_lab.koopman.lifted_samples import add_samples, lifted_samples
from koopman_lab.koopman.moments import Moments
from koopman_lab.robots.robot_type import POSE_DIM

Array = NDArray[np.float64]
GOOD_CONDITION = 300.0
"""Assumption: sets that excite the paper's dictionaries well have 16 to 120."""
MOST_EXCHANGES = 24
"""Orders of the basis inputs that are tried where data contradict them: all of up to four."""
FILES_EXCHANGED = "X_i.dat and Y_i.dat are exchanged: each row of Y follows that of X"


def data_verdict(
    dataset: DataSet,
    spans: Mapping[int, Excitation] | None = None,
    observables: Dictionary | None = None,
    *,
    cause_known: bool = False,
) -> Verdict:
    """Judge a data set.

    Parameters
    ----------
    dataset
        Pairs of any origin.
    spans
        How the samples of each basis input excite a dictionary, from :func:`excitations`; None
        leaves that out.
    observables
        The dictionary.
    cause_known
        Whether the verdict on its session says already why it may contradict the basis inputs.
    """
    spans = spans or {}
    motion = motion_of_data(dataset)
    figures: dict[str, Any] = {
        "pairs": {str(index): len(X) for index, X in sorted(dataset.X.items())},
        "motion": None if motion is None else motion.as_dict(),
        "excitation": {str(index): _excited(span) for index, span in spans.items()},
    }
    reasons = [*_of_counts(dataset)]
    if observables is not None:
        reasons += excitation_reasons(spans, observables)
    if motion is not None:
        reasons += _of_motion(dataset, motion, cause_known=cause_known)
    return verdict(reasons, figures)


def excitations(dataset: DataSet, observables: Dictionary) -> dict[int, Excitation]:
    """Return how the samples of each basis input excite a dictionary."""
    spans = {}
    for index in sorted(dataset.basis_inputs):
        moments = Moments(observables.size)
        add_samples(moments, lifted_samples(dataset, index, observables))
        spans[index] = excitation(moments)
    return spans


def _excited(span: Excitation) -> dict[str, Any]:
    finite = span.condition < float("inf")
    return {"rank": span.rank, "condition": span.condition if finite else None}


def _of_counts(dataset: DataSet) -> Iterator[Reason]:
    empty = [f"u_{index}" for index, X in sorted(dataset.X.items()) if not len(X)]
    if empty:
        yield Reason(
            "unusable",
            f"no sample of {', '.join(empty)}; record more segments with `klab calibrate`, or look "
            "at what the session lost",
        )


def excitation_reasons(
    spans: Mapping[int, Excitation], observables: Dictionary, *, regularised: bool = False
) -> Iterator[Reason]:
    """Give what keeps samples, by the index of their input, from training a dictionary.

    ``regularised`` says that a ridge decides what they leave open.
    """
    for index, span in spans.items():
        if span.samples and span.rank < span.observables:
            yield Reason(
                "weak",  # with further sessions they may suffice, or for another dictionary
                f"u_{index}: {span.samples} samples of {span.segments} segments span only "
                f"{span.rank} of the {span.observables} observables of "
                f"{observables.name}; "
                + ("the ridge decides the rest" if regularised else remedy(observables)),
            )
        elif span.samples and span.condition > GOOD_CONDITION:
            yield Reason(
                "weak",
                f"u_{index}: the samples span {observables.name} badly (condition "
                f"{span.condition:.0f}); "
                "record more segments from other states",
            )


def _of_motion(dataset: DataSet, motion: NominalMotion, *, cause_known: bool) -> list[Reason]:
    robot = dataset.robot
    if cause_known:
        return data_reasons(motion, robot, [])
    reasons = data_reasons(motion, robot, causes(motion, robot))
    if not any(reason.level == "unusable" for reason in reasons):
        return reasons
    remedied = [*_exchanges(dataset), *_frames(dataset)]
    return data_reasons(motion, robot, remedied) if remedied else reasons


def _exchanges(dataset: DataSet) -> Iterator[str]:
    """Name the exchanges of files or inputs without which the data would be as they should."""
    indices = sorted(index for index, X in dataset.X.items() if len(X))
    orders = itertools.islice(itertools.permutations(indices), 1, MOST_EXCHANGES)
    for order in orders:
        stated = {i: dataset.basis_inputs[j] for i, j in zip(indices, order, strict=True)}
        motion = motion_of_data(dataset, stated)
        if motion is not None and not data_reasons(motion, dataset.robot, []):
            names = [f"u_{i}" for i, j in zip(indices, order, strict=True) if i != j]
            yield (
                f"the inputs {' and '.join(names)} are exchanged; exchange their files, or give "
                "sampler.basis_inputs in the order of the data"
            )
    backwards = motion_of_data(_back_in_time(dataset))
    recorded = "runs" in dataset.metadata
    if not recorded and backwards is not None and not data_reasons(backwards, dataset.robot, []):
        yield FILES_EXCHANGED


def _frames(dataset: DataSet) -> Iterator[str]:
    """Name the wrong frames by whose correction the data would be as they should.

    Where velocities of the same frame stand behind the pose, they would have to be corrected, too,
    and nobody knows their part across the heading: :mod:`.likely_causes` tells from less.
    """
    if dataset.robot.state_dim > POSE_DIM:
        return
    for cause, correct in CORRECTIONS.items():
        X, Y = ({i: correct(x) for i, x in table.items()} for table in (dataset.X, dataset.Y))
        motion = motion_of_data(replace(dataset, X=X, Y=Y))
        if motion is not None and not data_reasons(motion, dataset.robot, []):
            yield cause


def _poses(
    position: Callable[[Array], Array], sign: float = 1.0, turn_rad: float = 0.0
) -> Callable[[Array], Array]:
    """Return what changes the positions (k, 2) and the headings of poses (k, 3)."""
    return lambda x: np.column_stack([position(x[:, :2]), sign * x[:, 2] + turn_rad])


def _mirrored(position: Array) -> Array:
    return position * (1.0, -1.0)


def _exchanged(position: Array) -> Array:
    return position[:, ::-1]


def _unchanged(position: Array) -> Array:
    return position


CORRECTIONS = {
    BACKWARDS: _poses(_unchanged, turn_rad=math.pi),
    MIRRORED_FRAME: _poses(_mirrored, -1.0),
    MIRRORED_AXIS: _poses(_mirrored),
    MIRRORED_HEADING: _poses(_unchanged, -1.0),
    EXCHANGED_AXES: _poses(_exchanged),
}
"""What undoes a wrong frame, by its name."""


def _back_in_time(dataset: DataSet) -> DataSet:
    """Return the data set with states and successors exchanged."""
    return replace(dataset, X=dataset.Y, Y=dataset.X)
