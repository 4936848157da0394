"""All robots on a bus as the page shows them: messages in, snapshots out. No clock, no socket."""

from __future__ import annotations

from typing import Any

from koopman_lab.bus.channel import OPERATOR, Channel
from koopman_lab.bus.channels import REPLAY_STATE
from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S
from offboard.monitor.robot_view import RobotView
from offboard.monitor.streams import GIVES_WAY_S, MOST_STREAMS, Streams, refusal_line

MOST_ROBOTS = 16
"""Names are free on a bus: who invents them endlessly fills no memory here."""
LEFT_OUT_S = 3.0
"""So long after its last message it is said that a robot has no place, or is not believed."""

Marks = tuple[tuple[str, int, int], ...]
"""By robot: its name, the row and the segment that a page wants next."""


class LabView:
    """All robots on a bus.

    Parameters
    ----------
    config
        What to assume of a robot as long as no session says its configuration.
    known_robot
        Name of the robot whose configuration this is, None if it is only an assumption.
    """

    def __init__(self, config: LabConfig, known_robot: str | None = None) -> None:
        self.robots: dict[str, RobotView] = {}
        self._config, self._known_robot = config, known_robot
        self._streams = Streams()
        self._left_out: tuple[str, int] | None = None
        """The newest robot without a place, and when it spoke (us)."""

    def take(self, name: str, data: bytes, arrived_us: int) -> None:
        """Take a message; what is none of a lab, or of its channel's type, is passed over."""
        stream = self._streams.take(name, data, arrived_us)
        if stream is None or stream.channel is None:
            return
        robot_name = name[: -len(stream.channel.suffix) - 1]
        robot = self.robots.get(robot_name)
        if robot is None:
            robot = self._view_of_newcomer(robot_name, stream.channel, arrived_us)
            if robot is None:
                return
        robot.take(stream, stream.channel, data, arrived_us)

    def refuse(self, name: str, data: bytes, arrived_us: int) -> None:
        """Count a message that lacks the lab's key, or was sent before."""
        self._streams.refuse(name, data, arrived_us)

    def refusals(self, now_us: int) -> str:
        """Return in words on which channels messages were not believed lately; empty for none."""
        return refusal_line(self._streams.refused_since(now_us - round(LEFT_OUT_S * US_PER_S)))

    def kinds_alive(self, now_us: int) -> dict[str, str]:
        """Return by name the kinds of the robots that are alive; empty where nobody knows it."""
        return {
            name: "" if robot.assumed else robot.config.robot.kind
            for name, robot in self.robots.items()
            if robot.alive(now_us) and not robot.replayed(now_us)
        }

    def snapshot(self, now_us: int) -> dict[str, Any]:
        """Return what every page shows now: by robot, all but the histories."""
        shown = {name: self.robots[name].snapshot(now_us) for name in sorted(self.robots)}
        for note in self._omissions(now_us):
            for robot in shown.values():
                robot["banners"].append(note)
        return shown

    def histories(self, marks: Marks) -> tuple[dict[str, Any], Marks]:
        """Return what a page does not have yet, and what it wants next.

        Parameters
        ----------
        marks
            From the call before; empty for a page that has nothing.
        """
        wanted_from = {name: (row, segment) for name, row, segment in marks}
        news, following = {}, []
        for name, robot in sorted(self.robots.items()):
            row, segment = wanted_from.get(name, (0, 0))
            rows = robot.rows.since(row)
            paths = robot.collected.paths.since(segment)
            news[name] = {
                "rows": rows._asdict(),
                "segments": paths._asdict() | {"items": [path._asdict() for path in paths.items]},
            }
            following.append((name, robot.rows.next, robot.collected.paths.next))
        return news, tuple(following)

    def _view_of_newcomer(self, name: str, channel: Channel[Any], now_us: int) -> RobotView | None:
        """Return the view of a robot that speaks for the first time, None if it has no place.

        What a person says to a robot is no robot: its name may be a slip. That of a replay is
        one of its log.
        """
        if channel.publisher == OPERATOR and channel is not REPLAY_STATE:
            return None
        if len(self.robots) == MOST_ROBOTS:
            silent = min(self.robots.values(), key=lambda robot: robot.replay_detection.spoken_us)
            if now_us - silent.replay_detection.spoken_us < GIVES_WAY_S * US_PER_S:
                self._left_out = name, now_us
                return None
            del self.robots[silent.name]
        robot = self.robots[name] = RobotView(name, self._config, known=name == self._known_robot)
        return robot

    def _omissions(self, now_us: int) -> list[str]:
        """Return what is not on the page."""
        notes = []
        if self._left_out is not None and _lately(self._left_out[1], now_us):
            name = self._left_out[0]
            notes.append(
                f"{name} speaks as well, but {MOST_ROBOTS} robots have all the places here: STOP "
                f"does not reach it from this page; `klab estop --robot-name {name}` does"
            )
        full_us = self._streams.full_us
        if full_us is not None and _lately(full_us, now_us):
            notes.append(
                f"more than {MOST_STREAMS} channels speak on this bus; what the others say is not "
                "shown"
            )
        return notes


def _lately(at_us: int, now_us: int) -> bool:
    return now_us - at_us <= LEFT_OUT_S * US_PER_S
