"""How a model was fitted, and what the data could and could not say of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from koopman_lab.koopman.combination import PAPER, Combination
from koopman_lab.koopman.defects import Defects
from koopman_lab.koopman.excitation import Excitation
from koopman_lab.koopman.lifted_samples import Estimator


@dataclass(frozen=True)
class Method:
    """How a model is fitted.

    Attributes
    ----------
    estimator
        Least squares, or instrumental variables (:mod:`koopman_lab.koopman.lifted_samples`).
    ridge
        Weight of a pull towards the identity (:func:`koopman_lab.koopman.fit.fit_moments`).
    symmetric
        Whether only models that commute with planar motions are fitted
        (:mod:`koopman_lab.koopman.symmetry`).
    combination
        How inputs are combined (:mod:`koopman_lab.koopman.combination`).
    """

    estimator: Estimator = "plain"
    ridge: float = 0.0
    symmetric: bool = False
    combination: Combination = PAPER


@dataclass(frozen=True)
class BasisReport:
    """What was learned for one basis input; ``None`` where the matrix follows from theory.

    ``weakest_instrument`` is None without instruments.
    """

    basis_index: int
    basis_input: tuple[float, ...]
    excitation: Excitation | None
    constant_residual: float
    residual_rms: dict[str, float]
    weakest_instrument: float | None = None


@dataclass(frozen=True)
class TrainingReport:
    """Everything ``klab train`` prints; ``defects`` is None for robots without a turn in place."""

    robot: str
    dictionary: str
    dt_s: float
    window: int | None
    method: Method
    data_hash: str
    bases: tuple[BasisReport, ...]
    defects: Defects | None

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON can hold it."""
        return asdict(self)
