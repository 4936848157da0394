"""The report on a reproduction: claims with their verdicts, figures, tables, commands."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.image import imread, imsave

from koopman_lab.errors import DataError
from koopman_lab.files import replacing, write_text
from offboard.reproduction.paper.claim import JudgedClaim
from offboard.reproduction.paper.page import (
    Block,
    Code,
    Heading,
    Image,
    Table,
    Text,
    as_html,
    as_markdown,
)
from offboard.reproduction.paper.pictures import GRIDS, PICTURES, STUDIES, Picture
from offboard.reproduction.paper.step_record import StepRecord
from offboard.reproduction.paper.step_results import StepResults
from offboard.reproduction.paper.verdict import Verdict

REPORT = "report"
RESULTS_PAGE = "results-page"
"""Folder of what the page of results shows (scripts/results): section.md and small figures."""
SMALLER = 2
"""By which figures of that page are smaller than those of the report."""
GRID_LIMITS_MM = (1.0, 2.0, 5.0)
FEW = 3
"""So many numbers of a claim fit into that page."""
TITLE = "Data-driven predictive control of nonholonomic robots: the paper's claims"


class Facts(NamedTuple):
    """What was reproduced.

    ``size`` says in words how much was run, ``seed`` is that of all draws, ``steps`` by name how
    each was made.
    """

    quick: bool
    size: str
    seed: int
    steps: Mapping[str, StepRecord]

    @property
    def in_words(self) -> str:
        """Return how much was run, with what, and how long it took."""
        minutes = sum(record.seconds for record in self.steps.values()) / 60.0
        versions = "; ".join(dict.fromkeys(record.version for record in self.steps.values()))
        return (
            f"{self.size} Seed {self.seed}; version {versions}; the steps took {minutes:.0f} min "
            "together."
        )


def write_report(
    folder: Path, facts: Facts, claims: Sequence[JudgedClaim], settings: Sequence[JudgedClaim]
) -> None:
    """Write ``report.md``, ``report.html``, and what the page of results shows.

    Parameters
    ----------
    folder
        Holds the steps' folders.
    facts
        What was reproduced.
    claims, settings
        Judged.

    Raises
    ------
    DataError
        If a figure cannot be read.
    """
    page = list(_page(folder, facts, claims, settings))
    write_text(folder / f"{REPORT}.md", as_markdown(page))
    write_text(folder / f"{REPORT}.html", as_html(page, folder))
    _write_results_page(folder, facts, claims)


def tally(judged: Sequence[JudgedClaim]) -> str:
    """Return how many claims got which verdict."""
    counted = {verdict: sum(j.verdict is verdict for j in judged) for verdict in Verdict}
    return ", ".join(f"{count} {verdict.value}" for verdict, count in counted.items() if count)


def _page(
    folder: Path, facts: Facts, claims: Sequence[JudgedClaim], settings: Sequence[JudgedClaim]
) -> Iterator[Block]:
    yield Heading(1, TITLE)
    yield Text(
        "M. Rosenfelder, L. Bold, H. Eschmann, P. Eberhard, K. Worthmann and H. Ebel, Data-Driven "
        "Predictive Control of Nonholonomic Robots Based on a Bilinear Koopman Realization: Data "
        "Does Not Replace Geometry. What it says in sections 4 to 6, beside what the commands "
        "below found; the lab of the paper is stood in for by a simulated one."
    )
    yield Text(f"{'QUICK RUN. ' if facts.quick else ''}{facts.in_words}")
    if facts.quick:
        yield Text(
            "All verdicts are of this quick run; they may change with the numbers of the paper."
        )
    yield Heading(2, "Claims")
    yield Text(
        f"{len(claims)} claims: {tally(claims)}. A verdict follows from the numbers by the rule "
        "beside it; of several numbers the weakest decides. Where the paper prints no number, the "
        "rule is ours."
    )
    for section in dict.fromkeys(judged.claim.section for judged in claims):
        yield Heading(3, f"Section {section}")
        yield Table(
            ("claim", "paper", "here", "holds if", "verdict", "from"),
            [
                (
                    f"{j.claim.name}: {j.claim.sentence}\n{j.claim.remark}".strip(),
                    j.claim.paper,
                    "\n".join(j.numbers),
                    "\n".join(j.rules),
                    _verdict(j, facts),
                    ", ".join(j.steps),
                )
                for j in claims
                if j.claim.section == section
            ],
        )
    yield Heading(2, "Setting")
    yield Text("What the paper prints of its setting, and what the steps ran with.")
    yield Table(
        ("section", "setting", "paper", "here", "same"),
        [
            (
                j.claim.section,
                j.claim.sentence,
                j.claim.paper,
                "\n".join(j.numbers),
                {Verdict.HOLDS: "yes", Verdict.UNKNOWN: "not measured"}.get(j.verdict, "no"),
            )
            for j in settings
        ],
    )
    yield Heading(2, "Figures")
    for picture in PICTURES:
        if picture.step not in facts.steps:
            continue
        yield Image(f"{picture.step}/{picture.stem}.png", _caption(picture))
        yield Code([facts.steps[picture.step].command])
    yield Heading(2, "Studies")
    yield Text("|x2| at the end of the runs of each case.")
    for study in STUDIES:
        if study in facts.steps:
            yield Heading(3, study)
            yield Code([facts.steps[study].command])
            yield _study_table(folder / study / "table.csv")
    for grid in GRIDS:
        if grid in facts.steps:
            yield Heading(3, grid)
            yield Code([facts.steps[grid].command])
            yield _grid_table(folder, grid)
    yield Heading(2, "Steps")
    yield Text("In the folder of this report, in this order.")
    yield Table(
        ("step", "command", "s", "version"),
        [
            (name, record.command, f"{record.seconds:.0f}", record.version)
            for name, record in facts.steps.items()
        ],
    )


def _verdict(judged: JudgedClaim, facts: Facts) -> str:
    return f"{judged.verdict.value}{' (quick run)' if facts.quick else ''}"


def _numbers_in_brief(judged: JudgedClaim) -> str:
    """Return all numbers where they are few, else the one that decided."""
    if len(judged.numbers) <= FEW:
        return "\n".join(judged.numbers)
    return f"the weakest of {len(judged.numbers)} is {judged.weakest}"


def _caption(picture: Picture) -> str:
    which = "Not in the paper" if picture.answers is None else f"Figure {picture.answers}"
    return f"{which}. {picture.caption}"


def _study_table(file: Path) -> Table:
    try:
        columns, *rows = csv.reader(file.read_text().splitlines())
    except (OSError, ValueError):
        raise DataError(f"{file}: no table can be read; run its step again") from None
    return Table(columns, [[_short_number(cell) for cell in row] for row in rows])


def _grid_table(folder: Path, grid: str) -> Table:
    """Return by cost what the largest |x2| of the last second is over the settings."""
    results, file, name = StepResults(folder), f"{grid}.csv", "x2_last_mm"
    rows = []
    for cost in dict.fromkeys(row["cost"] for row in results.rows(grid, file)):
        ends = results.column(grid, file, name, cost=cost)
        shares = [f"{100 * np.mean(ends < limit):.0f} %" for limit in GRID_LIMITS_MM]
        spread = [_short_number(str(value)) for value in np.quantile(ends, (0.0, 0.5, 1.0))]
        rows.append([cost, str(len(ends)), *spread, *shares])
    limits = (f"below {limit:g} mm" for limit in GRID_LIMITS_MM)
    return Table(("cost", "settings", "best mm", "median mm", "worst mm", *limits), rows)


def _short_number(cell: str) -> str:
    try:
        return f"{float(cell):.4g}"
    except ValueError:
        return cell


def _write_results_page(folder: Path, facts: Facts, claims: Sequence[JudgedClaim]) -> None:
    page: list[Block] = [
        Text(
            f"{'A quick run. ' if facts.quick else ''}{facts.in_words} {len(claims)} claims: "
            f"{tally(claims)}."
        ),
        Table(
            ("section", "claim", "paper", "here", "verdict"),
            [
                (
                    j.claim.section,
                    j.claim.sentence,
                    j.claim.paper,
                    _numbers_in_brief(j),
                    _verdict(j, facts),
                )
                for j in claims
            ],
        ),
    ]
    for picture in PICTURES:
        if picture.shown and picture.step in facts.steps:
            name = f"{picture.step}.png"
            _shrink(folder / picture.step / f"{picture.stem}.png", folder / RESULTS_PAGE / name)
            page.append(Image(name, _caption(picture)))
    write_text(folder / RESULTS_PAGE / "section.md", as_markdown(page))


def _shrink(source: Path, target: Path) -> None:
    """Average blocks of pixels of a PNG file."""
    try:
        pixels = imread(source)
    except OSError as error:
        raise DataError(f"{source}: cannot be read ({error.strerror})") from None
    rows, columns = (length // SMALLER * SMALLER for length in pixels.shape[:2])
    blocks = pixels[:rows, :columns, :3].reshape(
        rows // SMALLER, SMALLER, columns // SMALLER, SMALLER, 3
    )
    image = io.BytesIO()
    imsave(image, np.asarray(blocks.mean(axis=(1, 3))), format="png")
    with replacing(target) as file:
        file.write(image.getvalue())
