"""What calibration and parking share: a node that commands the robot, and everybody around it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer

from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.commanders import commander_number
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError
from offboard.lab.lab_lock import lab_lock
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_watch import RobotWatch
from offboard.lab.supervisor import present, start_missing, supervised
from offboard.terminal.output import err

INTERRUPTED = 130


@contextlib.contextmanager
def keeping_the_log(folder: RunFolder, then: str = "") -> Iterator[None]:
    """End the command after Ctrl-C inside the block; what was recorded stays, and is named.

    ``then`` is what a person can do next, after that and after an expected mistake.
    """
    try:
        yield
    except KeyboardInterrupt:
        if folder.log.exists():
            err.print(f"interrupted; what was recorded is in {folder.log}")
            err.print(then, end="\n" if then else "")
        raise typer.Exit(INTERRUPTED) from None
    except LabError as error:
        if then and folder.log.exists():
            raise type(error)(f"{error}\n{then}") from None
        raise


def in_real_time(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    commander: str,
    *arguments: str | Path,
    resume: bool = False,
    prepare: Callable[[set[str]], None] | None = None,
    watch: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Run a commanding node to its end and return the result that it wrote.

    Parameters
    ----------
    config, folder, listener
        Of this run.
    commander
        Name of the node: sampler, controller or reference.
    *arguments
        For its `klab run` command.
    resume
        Go on behind the log that is there.
    prepare
        Called when the others are ready, with the nodes that were there before.
    watch
        Called several times a second while the node runs.

    Raises
    ------
    LabStateError
        If a process dies or does not start, or the robot is held still, silent, or another's, or
        another command is about to start it.
    """
    result = folder.path / "processes" / f"{commander}.json"
    there = present(listener)
    robot = RobotWatch(config)
    listener.subscribe(ONBOARD_STATUS, lambda status: robot.see(status, listener.now_us()))
    with contextlib.ExitStack() as stack:
        if "onboard" not in there:
            stack.enter_context(lab_lock(config))
        lab = stack.enter_context(supervised(config, folder, listener))
        start_missing(lab, there, folder, resume=resume)
        if prepare is not None:
            prepare(there)
        lab.start(commander, *arguments, "--result", result)
        robot.commander = commander_number(commander, lab.process(commander))
        while not lab.ended(commander):
            listener.spin(0.2)
            lab.check()
            robot.check(listener.now_us())
            if watch is not None:
                watch()
        lab.check()
    facts: dict[str, Any] = json.loads(result.read_text())
    result.unlink()
    return facts
