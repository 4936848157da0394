"""Which robots speak on a bus, all of them, and what the motor loop of each says."""

from __future__ import annotations

from typing import Any

import lcmtypes
from koopman_lab.bus.channel import OPERATOR, Channel
from koopman_lab.bus.channels import ONBOARD_STATUS, split_name
from koopman_lab.bus.header import header_reader
from koopman_lab.errors import BusError
from offboard.monitor.latest_message import LatestMessage
from offboard.monitor.replay_detection import ReplayDetection

YOUNG_S = 1.0
"""What a motor loop said longer ago says nothing of now."""


class RobotsHeard:
    """Messages in, names out.

    Every name is kept, however many there are: this is for an order to all of them, which takes a
    few seconds; :class:`~offboard.monitor.lab_view.LabView` looks on for days.
    """

    def __init__(self) -> None:
        self._rows: dict[str, tuple[str, Channel[Any]] | None] = {}
        self._replay_detection: dict[str, ReplayDetection] = {}
        self._status: dict[str, LatestMessage[lcmtypes.onboard_status_t]] = {}

    def take(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a message; what is none of a lab, or what a person says to a robot, is none of it.

        A person's slip of a name makes no robot.
        """
        if name not in self._rows:
            self._rows[name] = _row(name)
        row = self._rows[name]
        if row is None or row[1].publisher == OPERATOR:
            return
        robot_name, channel = row
        header = header_reader(channel.type)(data)
        if header is None:
            return
        detection = self._replay_detection.setdefault(robot_name, ReplayDetection())
        detection.judge(channel, header[0], arrived_us)
        if channel is ONBOARD_STATUS:
            status = self._status.setdefault(robot_name, LatestMessage(ONBOARD_STATUS))
            status.take(data, arrived_us)

    def live(self, now_us: int) -> list[str]:
        """Return the robots that were heard and are no replays, in alphabetical order."""
        detections = self._replay_detection.items()
        return sorted(name for name, d in detections if not d.replayed(now_us))

    def replayed(self, now_us: int) -> list[str]:
        """Return the robots of which a log is sent again, in alphabetical order."""
        return sorted(self._replay_detection.keys() - set(self.live(now_us)))

    def status(self, robot_name: str, now_us: int) -> lcmtypes.onboard_status_t | None:
        """Return what the motor loop of a robot said last, None while it is silent."""
        status = self._status.get(robot_name)
        return None if status is None else status.young(now_us, YOUNG_S)


def _row(name: str) -> tuple[str, Channel[Any]] | None:
    try:
        return split_name(name)
    except BusError:
        return None
