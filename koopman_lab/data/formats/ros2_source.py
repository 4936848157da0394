"""Reads bags of ROS 2, of either storage: poses and commands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from koopman_lab.data.formats.decoded import NS_PER_US
from koopman_lab.data.formats.recorded_motion import (
    ACCELERATIONS,
    POSES,
    VELOCITIES,
    RecordedMessage,
)
from koopman_lab.errors import LogError


def bag_messages(folder: Path) -> Iterator[RecordedMessage]:
    """Give the messages of a bag that may hold poses or commands, the others undecoded.

    Where a bag says no definitions of its messages, as those of Humble with SQLite, they are the
    standard ones.

    Raises
    ------
    LogError
        If it cannot be read as a bag, or such a message not be decoded.
    """
    wanted = {*POSES, *VELOCITIES, *ACCELERATIONS}
    try:
        store = get_typestore(Stores.LATEST)
        with AnyReader([folder], default_typestore=store) as bag:
            for connection, time_ns, data in bag.messages():
                name = connection.msgtype
                message = bag.deserialize(data, name) if name in wanted else None
                yield RecordedMessage(connection.topic, name, message, time_ns // NS_PER_US)
    except (LogError, GeneratorExit):
        raise
    except Exception as error:  # whatever a damaged bag brings about
        raise LogError(
            f"{folder}: cannot be read as a ROS 2 bag ({type(error).__name__}: {error}); see "
            "whether it is whole: ros2 bag info"
        ) from None
