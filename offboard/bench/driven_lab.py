"""Lets the sampler drive a lab in real time, for as long as a bench measures beside it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.errors import LabStateError
from offboard.lab.session_watch import START_LIMIT_S

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.lab.run_folder import RunFolder
    from offboard.lab.supervisor import Supervisor

MORE_THAN_ENOUGH = "sampler.segments_per_basis=10000"
"""Segments per basis input: more than fit into any measurement."""
NO_RADIO_LOSS = tuple(f"simulation.radio.{way}.loss=0.0" for way in ("from_robot", "to_robot"))
"""So that whatever is missing was lost on this machine."""
WAIT_S = 1.0


@dataclass(frozen=True)
class DrivenLab:
    """A lab in which the sampler drives the robot while a bench measures.

    Attributes
    ----------
    config
        The lab; with :data:`MORE_THAN_ENOUGH` to do.
    folder
        Takes the session log, and what else a bench writes.
    listener
        Of this process.
    seconds
        How long, from the moment the robot is driven.
    report
        Told the seconds that have passed.
    """

    config: LabConfig
    folder: RunFolder
    listener: Listener
    seconds: float
    report: Callable[[float], None]

    def drive(self, lab: Supervisor, watch: Callable[[float], None] | None = None) -> None:
        """Let the sampler drive the robot of a lab that has plant, onboard loop and logger.

        Parameters
        ----------
        lab
            Has these processes running.
        watch
            Told the seconds that have passed, before they are reported.

        Raises
        ------
        LabStateError
            If a process dies or the robot is not driven.
        """
        self._wait_until_driven(lab)
        began_s = time.monotonic()
        while (passed_s := time.monotonic() - began_s) < self.seconds:
            self.listener.spin(min(WAIT_S, self.seconds - passed_s))
            lab.check()
            if lab.ended("sampler"):
                raise LabStateError(
                    f"sampler: ended after {passed_s:.0f} s; raise sampler.segments_per_basis"
                )
            if watch is not None:
                watch(passed_s)
            self.report(passed_s)

    def _wait_until_driven(self, lab: Supervisor) -> None:
        import lcmtypes
        from koopman_lab.bus.channels import ONBOARD_STATUS

        driven = False

        def hear(status: lcmtypes.onboard_status_t) -> None:
            nonlocal driven
            driven = driven or status.state == status.DRIVING

        self.listener.subscribe(ONBOARD_STATUS, hear)
        lab.start("sampler")
        began_s = time.monotonic()
        while not driven:
            self.listener.spin(WAIT_S)
            lab.check()
            if time.monotonic() - began_s > START_LIMIT_S:
                raise LabStateError(
                    f"{ONBOARD_STATUS.name(self.config.robot.name)}: the robot is not driven "
                    f"within {START_LIMIT_S:g} s; {self.folder.process_log('sampler')} may say why"
                )


@contextlib.contextmanager
def driven_lab(
    name: str, config: LabConfig, folder: Path | None, minutes: float, doing: str
) -> Iterator[DrivenLab]:
    """Give what a command of a bench measures by, and show how far it has come.

    Parameters
    ----------
    name
        Of the bench, for the folder where none is given.
    config
        The lab.
    folder
        Takes what is recorded; None for a new one.
    minutes
        How long to drive.
    doing
        What is done meanwhile, in a word or two.
    """
    from offboard.lab.run_folder import new_folder
    from offboard.lab.session_runner import keeping_the_log
    from offboard.terminal import options
    from offboard.terminal.output import progress

    listener, seconds = options.listen(config), 60.0 * minutes
    run = new_folder(folder, name, config)
    with keeping_the_log(run), progress(doing, "s") as report:
        yield DrivenLab(config, run, listener, seconds, lambda s: report(round(s), round(seconds)))
