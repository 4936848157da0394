"""The comparison of solvers as a table and as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from offboard.bench.ocp_comparison import NOTICEABLE, Row

if TYPE_CHECKING:
    from rich.table import Table


def as_table(rows: Sequence[Row]) -> Table:
    """Return the figures as a table."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True, title="one call, ms")
    for column in ("problem", "model", "solver"):
        table.add_column(column, no_wrap=True)
    for column in ("median", "p99", "max", "CPU", "CPU p99", "iter.", "worse", "build s"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.problem,
            row.model,
            row.solver,
            *(f"{ms:.2f}" for ms in (row.median_ms, row.p99_ms, row.max_ms)),
            *(f"{ms:.2f}" for ms in (row.cpu_median_ms, row.cpu_p99_ms)),
            f"{row.iterations_median:.0f}/{row.iterations_max}",
            f"{100.0 * row.worse_share:.1f} %",
            f"{row.build_s:.2f}",
        )
    return table


def remarks(rows: Sequence[Row]) -> list[str]:
    """Return what the figures say of our solver."""
    lines = []
    for row in rows:
        if row.solver != "ours":
            continue
        peers = [r for r in rows if (r.problem, r.model) == (row.problem, row.model)]
        factors = [
            f"{r.median_ms / row.median_ms:.1f} times as fast as {r.solver}"
            for r in peers
            if r.solver != "ours"
        ]
        lines.append(f"{row.problem}, {row.model}: ours is {', '.join(factors)}")
        lines += map(_explained, row.exceptions)
    return lines


def _explained(exception: dict[str, Any]) -> str:
    value, best = exception["value"], exception["best"]
    how = "stopped early" if exception["stopped_early"] else "another local minimum"
    stays = exception["ours_from_best"] <= best * (1.0 + NOTICEABLE)
    return (
        f"  state {exception['state']}: {value:.6g} against {best:.6g} "
        f"({100.0 * (value / best - 1.0):.2g} % more), {how}; ours from there "
        + ("does not leave it upwards" if stays else f"ends at {exception['ours_from_best']:.6g}")
    )
