"""How far an interrupted calibration session has come, by its log."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from koopman_lab.bus.channels import SAMPLER_STATE
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import UsageError
from koopman_lab.units import US_PER_S
from offboard.sampler.sampler_step import Progress


class Interrupted(NamedTuple):
    """An interrupted session.

    ``skipped_bytes`` of its log are damaged; ``next_us`` (us) is a second after its last message.
    """

    progress: Progress
    next_us: int
    skipped_bytes: int


def interrupted(folder: Path) -> Interrupted:
    """Read the session folder of a session that shall go on.

    Raises
    ------
    LogError
        If there is no log, or it cannot be used.
    UsageError
        If there is nothing to go on with, or nothing left to do.
    """
    log = SessionLog(folder, salvage=True)
    states = log.array(SAMPLER_STATE)
    name = SAMPLER_STATE.name(log.robot_name)
    if not len(states):
        raise UsageError(
            f"{log.path}: holds no {name}, so no session began; record it again in another folder"
        )
    last = states[-1]
    done, total = int(last["segments_done"]), int(last["segments_total"])
    if done == total:
        raise UsageError(
            f"{folder}: complete already, {done} of {total} segments; `klab train {folder}` is next"
        )
    progress = Progress(done, int(last["segment"]) + 1, int(last["samples"]), int(last["redraws"]))
    end_us = max(channel.last_us for channel in log.channels.values())
    return Interrupted(progress, end_us + US_PER_S, sum(d.size for d in log.damage))
