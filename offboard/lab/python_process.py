"""The command line that runs a module of this package in a process of its own."""

from __future__ import annotations

import sys
from pathlib import Path

# A person's folder may hold a file named like a module that is imported here.
FLAGS = ("-P",) if sys.version_info >= (3, 11) else ()


def module_command(module: str, *arguments: str | Path) -> list[str]:
    """Return the command that runs a module with this Python.

    The current folder is not searched for modules (from Python 3.11 on).
    """
    return [sys.executable, *FLAGS, "-m", module, *map(str, arguments)]
