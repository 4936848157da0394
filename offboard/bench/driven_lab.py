"""Lets the sampler drive a lab in real time, for as long as a bench measures beside it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from offboard.lab.session_watch import START_LIMIT_S

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from offboard.lab.run_folder import RunFolder
    from offboard.lab.supervisor import Supervisor

MORE_THAN_ENOUGH = 10_000
"""Segments per basis input: more than fit into any measurement."""
WAIT_S = 1.0


def drive(
    lab: Supervisor,
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    seconds: float,
    report: Callable[[float], None],
) -> None:
    """Let the sampler drive the robot of a lab that stands ready.

    Parameters
    ----------
    lab
        Has plant, onboard loop and logger running.
    config
        The lab; the sampler must have more to do than there is time.
    folder, listener
        Of this run.
    seconds
        From the moment the robot is driven.
    report
        Told the seconds that have passed.

    Raises
    ------
    LabStateError
        If a process dies or the robot is not driven.
    """
    import lcmtypes
    from koopman_lab.bus.channels import ONBOARD_STATUS

    statuses: list[lcmtypes.onboard_status_t] = []
    listener.subscribe(ONBOARD_STATUS, statuses.append)
    lab.start("sampler")
    began_s = time.monotonic()
    while not (statuses and statuses[-1].state == statuses[-1].DRIVING):
        del statuses[:-1]
        listener.spin(WAIT_S)
        lab.check()
        if time.monotonic() - began_s > START_LIMIT_S:
            raise LabStateError(
                f"{ONBOARD_STATUS.name(config.robot.name)}: the robot is not driven within "
                f"{START_LIMIT_S:g} s; {folder.process_log('sampler')} may say why"
            )
    began_s = time.monotonic()
    while (passed_s := time.monotonic() - began_s) < seconds:
        statuses.clear()
        listener.spin(min(WAIT_S, seconds - passed_s))
        lab.check()
        if lab.ended("sampler"):
            raise LabStateError(
                f"sampler: ended after {passed_s:.0f} s; raise sampler.segments_per_basis"
            )
        report(passed_s)
