"""A copy of the scripts beside a virtual environment that stands ready."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from guide_pages.pages import ROOT

from offboard.lab.python_process import module_command


def checkout(where: Path) -> Path:
    """Copy what the scripts read; return the folder of the programs that they find."""
    for name in ("scripts", "lcmtypes"):
        shutil.copytree(ROOT / name, where / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", where)
    programs = where / ".venv" / "bin"
    programs.mkdir(parents=True)
    # Not links: an environment of its own would begin where the link lies.
    for name, program in (
        ("python", [sys.executable]),
        ("klab", module_command("offboard.cli.main")),
    ):
        (programs / name).write_text(f'#!/bin/sh\nexec {shlex.join(program)} "$@"\n')
        (programs / name).chmod(0o755)
    fingerprint = subprocess.run(
        ["bash", "-c", ". scripts/installation.sh && fingerprint"],
        cwd=where,
        env={**os.environ, "ROOT": str(where)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    (where / ".venv" / ".installed").write_text(fingerprint)
    return programs
