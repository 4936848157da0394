"""What calibration and parking share: a node that commands the robot, and everybody around it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer

import lcmtypes
from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.units import US_PER_S
from offboard.console.folder import RunFolder
from offboard.console.supervisor import present, start_missing, supervised
from offboard.console.terminal import err

INTERRUPTED = 130
STOPPED_LIMIT_S = 3.0
FAULTS = ("no fault", "battery low", "encoders silent", "left wheel stuck", "right wheel stuck")
"""By the numbers of ``onboard_status_t``."""


@contextlib.contextmanager
def keeping_the_log(folder: RunFolder) -> Iterator[None]:
    """End the command after Ctrl-C inside the block; what was recorded stays, and is named."""
    try:
        yield
    except KeyboardInterrupt:
        if folder.log.exists():
            err.print(f"interrupted; what was recorded is in {folder.log}")
        raise typer.Exit(INTERRUPTED) from None


def in_real_time(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    commander: str,
    *arguments: str | Path,
    prepare: Callable[[set[str]], None] | None = None,
    watch: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Run a commanding node to its end and return the result that it wrote.

    Parameters
    ----------
    config, folder, listener
        Of this run.
    commander
        Name of the node: sampler or controller.
    *arguments
        For its `klab run` command.
    prepare
        Called when the others are ready, with the nodes that were there before.
    watch
        Called several times a second while the node runs.

    Raises
    ------
    LabStateError
        If a process dies or does not start.
    """
    result = folder.path / "processes" / f"{commander}.json"
    there = present(listener)
    stopped = _Stopped(listener, config)
    with supervised(config, folder, listener) as lab:
        start_missing(lab, there, folder)
        if prepare is not None:
            prepare(there)
        lab.start(commander, *arguments, "--result", result)
        while not lab.ended(commander):
            listener.spin(0.2)
            lab.check()
            stopped.check(listener.now_us())
            if watch is not None:
                watch()
        lab.check()
    facts: dict[str, Any] = json.loads(result.read_text())
    result.unlink()
    return facts


class _Stopped:
    """Notices a robot that only a person can release."""

    def __init__(self, listener: Listener, config: LabConfig) -> None:
        self._since_us: int | None = None
        self._why = ""
        self._channel = ONBOARD_STATUS.name(config.robot.name)
        self._listener = listener
        listener.subscribe(ONBOARD_STATUS, self._on_status)

    def check(self, now_us: int) -> None:
        """Refuse to wait for a person who does not know of it.

        Raises
        ------
        LabStateError
            If the robot has been held still for a while.
        """
        if self._since_us is not None and now_us - self._since_us > STOPPED_LIMIT_S * US_PER_S:
            raise LabStateError(
                f"{self._channel}: the robot is stopped ({self._why}); mend the cause, then "
                "`klab estop --release`, and start again"
            )

    def _on_status(self, status: lcmtypes.onboard_status_t) -> None:
        if status.state not in (status.ESTOP, status.FAULT):
            self._since_us = None
        elif self._since_us is None:
            self._since_us = self._listener.now_us()
            self._why = FAULTS[status.fault] if status.state == status.FAULT else "emergency stop"
