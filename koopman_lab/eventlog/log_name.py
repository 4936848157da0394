"""Where the log of a session is, and the summary that seals it."""

from __future__ import annotations

from pathlib import Path

LOG_NAME = "session.lcm"
"""The log of a session folder."""
SUMMARY_NAME = "summary.json"
"""What a finished session has come to."""


def log_file(path: Path) -> Path:
    """Return the log that is meant: ``path``, or ``session.lcm`` in it where it is a folder."""
    return path / LOG_NAME if path.is_dir() else path
