"""What the rows of a study say: the distribution of |x2| at the end, by case."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

PERCENTILES = (25, 50, 75, 90, 95, 99)
LIMITS_MM = (0.03, 1.0, 2.0, 5.0, 10.0, 50.0)
"""0.03 and 2 are the paper's (sections 4 and 5.4)."""
COLUMNS = (
    *("case", "runs", "failed", "unsolved_steps"),
    *(f"p{p}_mm" for p in PERCENTILES),
    "max_mm",
    *(f"share_below_{limit:g}_mm" for limit in LIMITS_MM),
)


def deviations_mm(rows: Sequence[dict[str, Any]]) -> dict[str, NDArray[np.float64]]:
    """Return by case |x2| at the end of its runs, in mm, sorted.

    A run that failed did not come to the goal: it counts as infinitely far.
    """
    by_case: dict[str, list[float]] = {}
    for row in rows:
        x2_m = row["x2_m"]
        by_case.setdefault(row["case"], []).append(np.inf if x2_m is None else 1e3 * abs(x2_m))
    return {case: np.sort(np.array(values)) for case, values in by_case.items()}


def deviation_table(rows: Sequence[dict[str, Any]], labels: Sequence[str]) -> Iterator[list[Any]]:
    """Yield a line of :data:`COLUMNS` for each label.

    A percentile is the smallest deviation that so many of the runs do not exceed.
    """
    final_mm = deviations_mm(rows)
    for label in labels:
        deviations, case_rows = final_mm[label], [row for row in rows if row["case"] == label]
        yield [
            label,
            len(deviations),
            sum(row["reason"] is not None for row in case_rows),
            sum(row["unsolved"] or 0 for row in case_rows),
            *np.percentile(deviations, PERCENTILES, method="inverted_cdf").tolist(),
            float(deviations[-1]),
            *(float(np.mean(deviations < limit)) for limit in LIMITS_MM),
        ]
