"""All events of a log, whichever of its files they are in."""

from __future__ import annotations

from pathlib import Path

from koopman_lab.eventlog.eventlog import Damage, Event, read_events
from koopman_lab.eventlog.log_name import log_file
from koopman_lab.eventlog.logwriter import files_of_log
from koopman_lab.eventlog.older_layouts import in_present_layout


def read_rotated_log(
    path: Path, *, salvage: bool = False, damage: list[Damage] | None = None
) -> list[Event]:
    """Return the events of a log in the order they were written.

    Messages of older layouts come in those of today
    (:mod:`~koopman_lab.eventlog.older_layouts`).

    Parameters
    ----------
    path
        A log, or the session folder that holds ``session.lcm``. The first file of a log that goes
        on in others stands for all of them.
    salvage, damage
        As for :func:`~koopman_lab.eventlog.eventlog.read_events`.

    Raises
    ------
    LogError
        As :func:`~koopman_lab.eventlog.eventlog.read_events`.
    """
    first = log_file(path)
    events: list[Event] = []
    for file in files_of_log(first) or [first]:
        if file == first or file.stat().st_size:  # a next file may be begun and ended by force
            written = read_events(file, salvage=salvage, damage=damage)
            events.extend(event._replace(data=in_present_layout(event.data)) for event in written)
    return events
