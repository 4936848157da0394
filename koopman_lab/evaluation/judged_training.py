"""Training with verdicts: on what it is given, and on what it brings, which the model keeps."""

from __future__ import annotations

from dataclasses import dataclass

from koopman_lab.data.source import Source
from koopman_lab.errors import DataError
from koopman_lab.evaluation.data_verdict import excitation_reasons
from koopman_lab.evaluation.fit_to_drive import with_verdict
from koopman_lab.evaluation.model_verdict import model_verdict
from koopman_lab.evaluation.plausibility import Verdict, verdict
from koopman_lab.evaluation.session_verdict import recorded_verdicts
from koopman_lab.koopman.bilinear_model import BilinearModel
from koopman_lab.koopman.fit import regularises
from koopman_lab.koopman.training_report import Method, TrainingReport
from koopman_lab.predictors.predictor import LearnedModel
from koopman_lab.predictors.table import PREDICTORS, Report, Trainer, trainer_of


@dataclass(frozen=True)
class JudgedModel:
    """What a training brought.

    Attributes
    ----------
    model
        The model, with the verdicts in its metadata.
    report
        What the training tells of it.
    verdict
        What is made of the model.
    """

    model: LearnedModel
    report: Report
    verdict: Verdict


class JudgedTrainer:
    """Learns a model from sources, taken in one after the other, and judges all of it.

    Parameters
    ----------
    predictor
        What is learned, a row of the table of predictors.
    dictionary
        Name or expressions of the dictionary; None for what the first source says.
    method
        How to fit.

    Raises
    ------
    ConfigError
        If there is no such predictor.
    PluginError
        If it is another package's, and cannot be used.
    """

    def __init__(
        self, predictor: str = "edmd", dictionary: str | None = None, method: Method | None = None
    ) -> None:
        PREDICTORS.get(predictor)  # before hours of data are read
        self._predictor, self._dictionary = predictor, dictionary
        self._method = method or Method()
        self._trainer: Trainer | None = None
        self.verdicts: list[dict[str, Verdict]] = []
        """Of each source so far: on its data and, where it says of what session, on the session."""

    def add(self, source: Source) -> None:
        """Take in a source.

        Raises
        ------
        LabError
            If it holds no pairs at all, or the trainer cannot use it, as
            :meth:`koopman_lab.koopman.trainer.Trainer.add` says.
        """
        if self._trainer is None:
            observables = self._dictionary or source.dictionary
            self._trainer = trainer_of(self._predictor, observables, self._method)
        self.verdicts.append(judged_source(source))
        self._trainer.add(source.dataset)

    def result(self) -> JudgedModel:
        """Learn the model.

        Raises
        ------
        LabError
            If there are no sources, or together they do not give a model.
        """
        if self._trainer is None:
            raise DataError("nothing to train with; name a session of `klab calibrate`")
        learned, report = self._trainer.result()
        usable = all(v.usable for of_source in self.verdicts for v in of_source.values())
        judged = judged_model(learned, report, data_usable=usable)
        return JudgedModel(with_verdict(learned, judged, self.verdicts), report, judged)


def judged_source(opened: Source) -> dict[str, Verdict]:
    """Judge a data set and, where it says of what session it is, the session: by these names.

    Raises
    ------
    DataError
        If it holds no pairs at all; the message says why, as far as the session tells.
    """
    verdicts = recorded_verdicts(opened.dataset)
    if not any(map(len, opened.dataset.X.values())):
        reasons = [r.text for v in verdicts.values() for r in v.reasons if r.level == "unusable"]
        raise DataError(f"{opened.file}: {'; '.join(reasons)}")
    return verdicts


def judged_model(learned: LearnedModel, report: Report, *, data_usable: bool) -> Verdict:
    """Judge a model, and how well its data excite its dictionary as far as the report says it.

    Where the data are unusable, their verdict names the cause.
    """
    judged = model_verdict(learned, cause_known=not data_usable)
    if not isinstance(report, TrainingReport) or not isinstance(learned, BilinearModel):
        return judged
    if report.method.symmetric:
        return judged  # a symmetric fit asks less of its samples
    spans = {b.basis_index: b.excitation for b in report.bases if b.excitation is not None}
    regularised = regularises(report.method.ridge)
    reasons = excitation_reasons(spans, learned.dictionary, regularised=regularised)
    return verdict([*judged.reasons, *reasons], judged.figures)
