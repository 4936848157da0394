"""Whether a controller may plan with a model: signs, geometry, and what its data were like.

A model keeps the verdicts of its training. What it predicts is judged anew whenever it is to drive,
since older models keep none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace

from koopman_lab.config.schema import LabConfig
from koopman_lab.data.source import geometry_of
from koopman_lab.errors import ModelError
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.evaluation.plausibility import Reason, Verdict, from_dict, verdict
from koopman_lab.predictors.predictor import LearnedModel

STORED = "verdict"
"""Where the metadata of a model keep the verdict that it was trained with; older ones have none."""
LARGEST_DIFFERENCE = 0.01
"""Of a length of the robot. Assumption: so exactly is it known; its wheels differ as much."""


def require_fit_to_drive(model: LearnedModel, config: LabConfig) -> Verdict:
    """Refuse a model that would drive this lab's robot the wrong way; return what else is weak.

    A controller that plans with the nominal equations takes nothing of a model but its marker
    offset, and is not refused.

    Raises
    ------
    ModelError
        If the model, or what it was trained with, contradicts the nominal equations, or if it is of
        another geometry.
    """
    if config.controller.predict == "nominal":
        return verdict([], {})
    of_data = [r.text for r in stored_reasons(model, "data") if r.level == "unusable"]
    judged = model_verdict(model, cause_known=bool(of_data))
    if of_data or not judged.usable:
        of_model = [] if judged.usable else [judged.text]
        raise ModelError(
            f"the model ({model.name}) must not drive a robot: {'; '.join([*of_model, *of_data])}"
        )
    # What was weak in its data need not show in the model.
    weak = [
        Reason("weak", f"its data: {r.text}") for r in stored_reasons(model) if r.level != "good"
    ]
    return verdict([*judged.reasons, *_of_geometry(model, config), *weak], judged.figures)


def _of_geometry(model: LearnedModel, config: LabConfig) -> Iterator[Reason]:
    trained = geometry_of(model.metadata.get("data", {}))
    for name, value in trained.items():
        present = getattr(config.robot, name)
        if value is None or value == present:
            continue
        text = f"it was trained with robot.{name} {value:g}, the lab says {present:g}"
        if abs(value / present - 1.0) > LARGEST_DIFFERENCE:
            raise ModelError(
                f"the model ({model.name}) is of another geometry: {text}; train a model from a "
                f"session of this robot, or set robot.{name} to what it is"
            )
        yield Reason("weak", text)


def with_verdict(
    model: LearnedModel, judged: Verdict, sources: Sequence[Mapping[str, Verdict]]
) -> LearnedModel:
    """Return the model with verdicts in its metadata, as far as its class takes any.

    Parameters
    ----------
    model
        As it was learned.
    judged
        What is made of it.
    sources
        What is made of each data set that it was learned from, and of its session, by these names.
    """
    if not is_dataclass(model) or "metadata" not in {f.name for f in fields(model) if f.init}:
        return model
    kept = [
        {
            name: {k: v for k, v in part.as_dict().items() if k != "figures"}
            for name, part in s.items()
        }
        for s in sources
    ]
    stored = {STORED: {"model": judged.as_dict(), "sources": kept}}
    changed: LearnedModel = replace(model, metadata=dict(model.metadata) | stored)
    return changed


def stored_reasons(model: LearnedModel, of: str | None = None) -> Iterator[Reason]:
    """Give the reasons by which what a model was trained with was judged then.

    ``of`` is ``data`` or ``session``; None for both.
    """
    for source in model.metadata.get(STORED, {}).get("sources", ()):
        for name, part in source.items():
            if of in (None, name):
                yield from from_dict(part).reasons
