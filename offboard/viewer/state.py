"""The state of the page: every message of every robot in, snapshot out. No clock, no socket."""

from __future__ import annotations

from typing import Any

from koopman_lab.config.schema import LabConfig
from offboard.viewer.robot import RobotView
from offboard.viewer.streams import Streams

MOST_ROBOTS = 16
"""Names are free on a bus: who invents them endlessly fills no memory here."""

Marks = tuple[tuple[str, int, int], ...]
"""By robot: its name, the row and the segment that a page wants next."""


class LabView:
    """All robots on a bus.

    Parameters
    ----------
    config
        What to assume of a robot as long as no session says its configuration.
    """

    def __init__(self, config: LabConfig) -> None:
        self.robots: dict[str, RobotView] = {}
        self._config = config
        self._streams = Streams()

    def take(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a message; what is none of a lab, or of its channel's type, is passed over."""
        stream = self._streams.take(name, data, arrived_us)
        if stream is None or stream.channel is None:
            return
        robot_name = name[: -len(stream.channel.suffix) - 1]
        robot = self.robots.get(robot_name)
        if robot is None:
            if len(self.robots) == MOST_ROBOTS:
                return
            robot = self.robots[robot_name] = RobotView(robot_name, self._config)
        robot.take(stream, stream.channel, data, arrived_us)

    def snapshot(self, now_us: int) -> dict[str, Any]:
        """Return what every page shows now: by robot, all but the histories."""
        return {name: self.robots[name].snapshot(now_us) for name in sorted(self.robots)}

    def histories(self, marks: Marks) -> tuple[dict[str, Any], Marks]:
        """Return what a page does not have yet, and what it wants next.

        Parameters
        ----------
        marks
            From the call before; empty for a page that has nothing.
        """
        wanted = {name: (row, segment) for name, row, segment in marks}
        news, following = {}, []
        for name, robot in sorted(self.robots.items()):
            row, segment = wanted.get(name, (0, 0))
            rows = robot.rows.since(row)
            paths = robot.collected.paths.since(segment)
            news[name] = {
                "rows": rows._asdict(),
                "segments": paths._asdict() | {"items": [path._asdict() for path in paths.items]},
            }
            following.append((name, robot.rows.next, robot.collected.paths.next))
        return news, tuple(following)
