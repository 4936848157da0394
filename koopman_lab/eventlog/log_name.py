"""Where the log of a session is, and the summary that seals it."""

from __future__ import annotations

from pathlib import Path

LOG_NAME = "session.lcm"
"""The log of a session folder."""
SUMMARY_NAME = "summary.json"
"""What a finished session has come to."""
CALIBRATION_NAME = "calibration"
"""The folder of the session in that of a demo, which goes on to train and park."""


def log_file(path: Path) -> Path:
    """Return the log that is meant.

    It is ``path``; where that is a folder ``session.lcm`` in it, and where that is not there, but a
    session in ``calibration``, as `klab demo` leaves it, that one.
    """
    if not path.is_dir():
        return path
    inside = path / CALIBRATION_NAME / LOG_NAME
    return inside if inside.exists() and not (path / LOG_NAME).exists() else path / LOG_NAME
