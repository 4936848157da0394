"""`klab model`: what a model file says of itself."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from offboard.terminal import options
from offboard.terminal.choices import Commands
from offboard.terminal.needs import needs
from offboard.terminal.output import out, show_verdicts

app = Commands(help="Look into model files.", no_args_is_help=True)

INDENT = "  "
MOST_AXES = 2
"""Of the arrays that are shown: basis inputs, but no stack of matrices."""


@app.callback()
def _group() -> None:
    """Keep `info` a subcommand although it is the only one."""


@app.command()
@needs("desk")
def info(
    file: Annotated[Path, typer.Argument(metavar="MODEL", help="From `klab train`.")],
    as_json: options.AsJson = False,
) -> None:
    """Say what a model is, what it was learned from, how well, and by which versions.

    Everything that its file holds but the matrices; numbers to six digits, as --json in full. At
    the end the verdicts on its data, as it was trained, and on what it predicts.

    Example: klab model info runs/model.npz
    """
    from koopman_lab.evaluation.fit_to_drive import STORED
    from koopman_lab.evaluation.model_verdict import model_verdict
    from koopman_lab.evaluation.plausibility import from_dict
    from koopman_lab.files import sha256
    from koopman_lab.koopman.model_file import read_model_file
    from koopman_lab.predictors.table import model_of

    read = read_model_file(file)
    judged = model_verdict(model_of(read))
    # As it was written: whatever a version adds to it is shown without a word here.
    _, header, arrays = read
    metadata = header.pop("metadata")
    stored = metadata.pop(STORED, {})
    small = {name: a.tolist() for name, a in sorted(arrays.items()) if a.ndim <= MOST_AXES}
    facts = {"file": str(file), "sha256": sha256(file), **header, **small, **metadata}
    if as_json:
        out.print_json(json.dumps(facts | {STORED: stored | {"model": judged.as_dict()}}))
        return
    for line in lines(facts):
        out.print(line)
    for source in stored.get("sources", ()):
        parts = sorted(source.items(), reverse=True)  # the session before its data
        show_verdicts({name: from_dict(part) for name, part in parts}, out)
    show_verdicts({"model": judged}, out)


def lines(value: Any, indent: str = "") -> Iterator[str]:
    """Yield a value of JSON as lines: nested tables indented, lists of plain values in one line."""
    items = value.items() if isinstance(value, Mapping) else enumerate(value)
    for key, item in items:
        if _fits_a_line(item):
            yield f"{indent}{key}: {_plain(item)}"
        else:
            yield f"{indent}{key}:"
            yield from lines(item, indent + INDENT)


def _fits_a_line(value: Any) -> bool:
    if isinstance(value, list):
        return not any(isinstance(item, (dict, list)) for item in value)
    return not isinstance(value, dict) or not value


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_plain, value)) or "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None or value == {} else str(value)
