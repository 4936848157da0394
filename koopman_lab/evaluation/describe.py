"""What a data set holds, and what of a dictionary it excites."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from koopman_lab.data.dataset import DataSet
from koopman_lab.data.source import window_of
from koopman_lab.evaluation.data_verdict import excitations
from koopman_lab.evaluation.session_verdict import recorded_verdicts
from koopman_lab.koopman.dictionary import dictionary


def describe(dataset: DataSet, dictionary_name: str) -> dict[str, Any]:
    """Return facts about a data set as JSON can hold them.

    For each basis input: its value, the number of pairs and runs, the smallest and the largest
    value of each state, in its unit, the number of successors whose angle lies outside (-pi, pi],
    and the
    :class:`~koopman_lab.koopman.excitation.Excitation` of the dictionary. Then what is made of it:
    the verdicts on the data and, where they say of what session they are, on the session.

    Raises
    ------
    ModelError
        If there is no such dictionary for the robot.
    """
    observables = dictionary(dictionary_name, dataset.robot_kind)
    names = dataset.robot.state_names
    spans = excitations(dataset, observables)
    bases = {}
    for index, u in sorted(dataset.basis_inputs.items()):
        X, Y = dataset.X[index], dataset.Y[index]
        excited = asdict(spans[index])
        if not np.isfinite(excited["condition"]):
            excited["condition"] = None
        bases[str(index)] = {
            "input": u.tolist(),
            "pairs": len(X),
            "segments": len(np.unique(dataset.segments[index])),
            "ranges": {
                name: [float(x.min()), float(x.max())] if len(x) else None
                for name, x in zip(names, X.T, strict=True)
            },
            "angles_continued": int(np.count_nonzero(np.abs(Y[:, 2]) > np.pi)),
            "excitation": excited,
        }
    return {
        "robot": dataset.robot_kind,
        "dt_s": dataset.dt_s,
        "window": window_of(dataset),
        "pairs": sum(len(x) for x in dataset.X.values()),
        "data_hash": dataset.data_hash,
        "source": dataset.metadata.get("source"),
        "marker": dataset.metadata.get("marker"),
        "dictionary": observables.name,
        "basis_inputs": bases,
        "verdicts": {
            name: verdict.as_dict()
            for name, verdict in recorded_verdicts(dataset, spans, observables).items()
        },
    }
