"""How a command that the page started has ended, in words: by what it left and what it said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from koopman_lab.errors import LabError, LabStateError
from koopman_lab.json_file import JsonTable, Refusal, read_table
from offboard.lab.child_process import exit_text
from offboard.lab.run_folder import RunFolder
from offboard.lab.run_history import past_model
from offboard.lab.run_outcome import outcome_of
from offboard.monitor.state_in_words import BAD, GOOD, IDLE, WARN, StateInWords

MISTAKE = "klab: "
"""How the command begins what it says of an expected mistake."""
LONGEST_DETAIL = 400
MODEL_NAME = "model.npz"


def job_outcome(
    code: int, said: Sequence[str], folder: Path | None, *, stopped: bool
) -> StateInWords:
    """Return how a command ended.

    Parameters
    ----------
    code
        Its exit code; below 0 the signal that ended it.
    said
        The last lines of what it said.
    folder
        Its run folder, None where it has none.
    stopped
        Whether a person ended it.
    """
    if folder is not None:
        left = _left_behind(folder)
        if left is not None:
            return left
    if stopped:
        return StateInWords("ended by hand", IDLE, _kept(folder))
    if code == 0:
        return StateInWords("done", GOOD)
    mistake = _mistake(said)
    if " died (" in mistake:
        return StateInWords("process died", BAD, mistake)
    if code < 0:
        return StateInWords("killed", BAD, exit_text(code))
    return StateInWords("failed", BAD, mistake or f"{exit_text(code)}: {' '.join(said[-2:])}")


def _left_behind(folder: Path) -> StateInWords | None:
    """Return how it ended by the summary or the model that it left; None if it left neither."""
    refusal = Refusal(RunFolder(folder).summary, "a summary", "see the log", LabStateError)
    try:
        return outcome_of(read_table(refusal, JsonTable).model_dump())
    except LabError:
        pass
    file = folder / MODEL_NAME
    model = past_model(file, file.stat()) if file.is_file() else None
    if model is None:
        return None
    tone = WARN if model.verdict in ("weak", "unusable") else GOOD
    verdict = f", model {model.verdict}" if model.verdict else ""
    return StateInWords("trained", tone, f"{model.name}, {model.robot} robot{verdict}")


def _mistake(said: Sequence[str]) -> str:
    """Return what the command said of a mistake, with the lines behind it."""
    for number, line in enumerate(said):
        if line.startswith(MISTAKE):
            text = "\n".join([line.removeprefix(MISTAKE), *said[number + 1 :]])
            return text if len(text) <= LONGEST_DETAIL else f"{text[:LONGEST_DETAIL]}..."
    return ""


def _kept(folder: Path | None) -> str:
    """Return what is left of a run that a person ended."""
    if folder is None or not RunFolder(folder).log.exists():
        return ""
    return "what was recorded is kept"
