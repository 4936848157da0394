"""The verdicts of a training: on what it is given, and on what it brings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from koopman_lab.errors import DataError

if TYPE_CHECKING:
    from koopman_lab.data.source import Source
    from koopman_lab.evaluation.plausibility import Verdict
    from koopman_lab.predictors.predictor import LearnedModel
    from koopman_lab.predictors.table import Report


def judged_source(opened: Source) -> dict[str, Verdict]:
    """Judge a data set and, where it says of what session it is, the session: by these names.

    Raises
    ------
    DataError
        If it holds no pairs at all; the message says why, as far as the session tells.
    """
    from koopman_lab.evaluation.session_verdict import recorded_verdicts

    verdicts = recorded_verdicts(opened.dataset)
    if not any(map(len, opened.dataset.X.values())):
        reasons = [r.text for v in verdicts.values() for r in v.reasons if r.level == "unusable"]
        raise DataError(f"{opened.file}: {'; '.join(reasons)}")
    return verdicts


def judged_model(learned: LearnedModel, report: Report, *, data_usable: bool) -> Verdict:
    """Judge a model, and how well its data excite its dictionary as far as the report says it.

    Where the data are unusable, their verdict names the cause.
    """
    from koopman_lab.evaluation.data_verdict import excitation_reasons
    from koopman_lab.evaluation.model_verdict import model_verdict
    from koopman_lab.evaluation.plausibility import verdict
    from koopman_lab.koopman.bilinear_model import BilinearModel
    from koopman_lab.koopman.fit import regularises
    from koopman_lab.koopman.training_report import TrainingReport

    judged = model_verdict(learned, cause_known=not data_usable)
    if not isinstance(report, TrainingReport) or not isinstance(learned, BilinearModel):
        return judged
    if report.method.symmetric:
        return judged  # a symmetric fit asks less of its samples
    spans = {b.basis_index: b.excitation for b in report.bases if b.excitation is not None}
    regularised = regularises(report.method.ridge)
    reasons = excitation_reasons(spans, learned.dictionary, regularised=regularised)
    return verdict([*judged.reasons, *reasons], judged.figures)
