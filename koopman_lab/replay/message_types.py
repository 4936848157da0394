"""Which channels of a log this version can read, and which a node cannot do without."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from koopman_lab.bus.channels import all_channels
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Event


def unreadable_channels(config: LabConfig, events: Sequence[Event]) -> dict[str, int]:
    """Return the channels none of whose messages is of its type, and how many messages they have.

    They were recorded with types of another version that nobody translates
    (:mod:`~koopman_lab.eventlog.older_layouts`). A single message of another type is damage, or
    somebody's nonsense, and says nothing of the channel.
    """
    robot = config.robot.name
    fingerprints = {c.name(robot): c.type._get_packed_fingerprint() for c in all_channels()}
    counts: Counter[str] = Counter()
    readable = set()
    for event in events:
        fingerprint = fingerprints.get(event.channel)
        if fingerprint is not None:
            counts[event.channel] += 1
            if event.data.startswith(fingerprint):
                readable.add(event.channel)
    return {name: count for name, count in sorted(counts.items()) if name not in readable}


def require_readable(needed: Iterable[str], unreadable: Mapping[str, int]) -> None:
    """Refuse a log in which a channel that is needed cannot be read.

    Raises
    ------
    LogError
        Names the channels.
    """
    missing = sorted(set(needed) & unreadable.keys())
    if missing:
        raise LogError(
            f"{', '.join(missing)}: recorded with other message types; run again with the version "
            "of koopman-lab that recorded the log, or record it anew"
        )
