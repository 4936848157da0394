"""Run folders: where a run's files are, and what every run leaves."""

from __future__ import annotations

import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from koopman_lab.errors import UsageError
from koopman_lab.eventlog.log_name import LOG_NAME, SUMMARY_NAME
from koopman_lab.files import write_json, write_text, writing_where_named

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig


@dataclass(frozen=True)
class RunFolder:
    """Paths inside one run folder."""

    path: Path

    @property
    def log(self) -> Path:
        """Return where the session log is."""
        return self.path / LOG_NAME

    @property
    def config(self) -> Path:
        """Return where the configuration is."""
        return self.path / "config.yaml"

    @property
    def summary(self) -> Path:
        """Return where the summary is."""
        return self.path / SUMMARY_NAME

    def process_log(self, name: str) -> Path:
        """Return where a process writes what it has to say."""
        return self.path / "processes" / f"{name}.log"

    def write_config(self, config: LabConfig) -> None:
        """Write the configuration as it is used.

        Raises
        ------
        NotWrittenError
            If it cannot be written.
        """
        from koopman_lab.config.load import dump_config

        with writing_where_named(self.path):
            write_text(self.config, dump_config(config))

    def write_summary(self, config: LabConfig, facts: dict[str, Any]) -> None:
        """Write ``summary.json``: the facts, what the run was made with, and the seal of its log.

        Raises
        ------
        NotWrittenError
            If it cannot be written.
        """
        from importlib.metadata import version

        from koopman_lab.eventlog.seal import seal_of

        made_with: dict[str, Any] = {
            "robot": config.robot.kind,
            "seed": config.seed,
            "version": version("koopman-lab"),
            "revision": revision(),
        }
        whole = f"make room on the disk. What was recorded is whole: {self.log}"
        with writing_where_named(self.summary, whole):
            seal = {name: file.model_dump() for name, file in seal_of(self.log).items()}
            if seal:
                made_with["log_files"] = seal
            write_json(self.summary, facts | made_with)


def run_path(out: Path | None, what: str) -> Path:
    """Return the folder a person named, or one in ``runs`` by the present time."""
    return out if out is not None else Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-{what}"


def new_folder(out: Path | None, what: str, config: LabConfig) -> RunFolder:
    """Make a run folder and write the configuration into it.

    Raises
    ------
    UsageError
        If the folder holds a run already.
    NotWrittenError
        If it cannot be made.
    """
    folder = RunFolder(run_path(out, what))
    if folder.log.exists() or folder.summary.exists():
        raise UsageError(f"{folder.path}: holds a run already; choose another folder with --out")
    folder.write_config(config)
    return folder


def revision() -> str | None:
    """Return the git revision of the source tree, None where there is none."""
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=False,
        )
    except FileNotFoundError:
        return None
    return described.stdout.strip() or None
