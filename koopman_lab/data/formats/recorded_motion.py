"""Poses and commands in the recordings of other programs, whatever they call them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.errors import LogError
from koopman_lab.units import US_PER_S

USUAL_COMMANDS = ("cmd_vel", "cmd_accel")
"""How ROS calls commands; of several topics with velocities, others are what was measured."""


class RecordedMessage(NamedTuple):
    """A message of a recording: topic, name of its type, decoded, and when it was recorded (us)."""

    topic: str
    type_name: str
    message: Any
    recorded_us: int


class Stream(NamedTuple):
    """What one topic says: times (N,) in us, and values (N, k), both in the order of time.

    Poses are in m, m, rad; commands as the forward and the turning component, in m/s and rad/s or
    m/s^2 and rad/s^2.
    """

    topic: str
    type_name: str
    utime_us: NDArray[np.int64]
    values: NDArray[np.float64]


class RecordedMotion(NamedTuple):
    """Poses of a tracked body and the commands that it was given."""

    poses: Stream
    commands: Stream


class _Kind(NamedTuple):
    """How to read a type of message: what holds its values, and its stamp, None without one."""

    values: Callable[[Any], tuple[float, ...]]
    stamp: Callable[[Any], Any] | None


def _planar(pose: Any) -> tuple[float, float, float]:
    """Return x, y and the turn about z of a pose in space."""
    q = pose.orientation
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return pose.position.x, pose.position.y, yaw


def _forward_and_turn(motion: Any) -> tuple[float, float]:
    return motion.linear.x, motion.angular.z


def _header_stamp(message: Any) -> Any:
    return message.header.stamp


POSES: Mapping[str, _Kind] = {
    "geometry_msgs/msg/PoseStamped": _Kind(lambda m: _planar(m.pose), _header_stamp),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _Kind(
        lambda m: _planar(m.pose.pose), _header_stamp
    ),
    "nav_msgs/msg/Odometry": _Kind(lambda m: _planar(m.pose.pose), _header_stamp),
    "foxglove.PoseInFrame": _Kind(lambda m: _planar(m.pose), lambda m: m.timestamp),
}
"""Types that hold a pose."""
VELOCITIES: Mapping[str, _Kind] = {
    "geometry_msgs/msg/TwistStamped": _Kind(lambda m: _forward_and_turn(m.twist), _header_stamp),
    "geometry_msgs/msg/Twist": _Kind(_forward_and_turn, None),
}
ACCELERATIONS: Mapping[str, _Kind] = {
    "geometry_msgs/msg/AccelStamped": _Kind(lambda m: _forward_and_turn(m.accel), _header_stamp),
    "geometry_msgs/msg/Accel": _Kind(_forward_and_turn, None),
}


def recorded_motion(
    path: Path,
    messages: Iterable[RecordedMessage],
    commands: Mapping[str, _Kind],
    *,
    pose_topic: str | None = None,
    command_topic: str | None = None,
) -> RecordedMotion:
    """Return poses and commands of a recording.

    A message counts for when it was stamped, or, where it has no stamp, for when it was recorded.
    What is no number is left out.

    Parameters
    ----------
    path
        For messages.
    messages
        Of the recording.
    commands
        Types that hold a command of the robot: :data:`VELOCITIES` or :data:`ACCELERATIONS`.
    pose_topic, command_topic
        Which topics are meant, where there are several and none is called as ROS calls commands.

    Raises
    ------
    LogError
        If there is no such topic, or several and none is named.
    """
    kinds = {**POSES, **commands}
    topics: dict[tuple[str, str], list[tuple[int, tuple[float, ...]]]] = {}
    others: set[str] = set()
    for topic, type_name, message, recorded_us in messages:
        kind = kinds.get(type_name)
        if kind is None:
            others.add(f"{topic} ({type_name})")
            continue
        at_us, values = _stamp_us(kind, message, recorded_us), kind.values(message)
        if all(map(math.isfinite, values)):
            topics.setdefault((topic, type_name), []).append((at_us, values))
    streams = [_stream(*key, rows) for key, rows in sorted(topics.items())]
    found = [f"{stream.topic} ({stream.type_name})" for stream in streams]
    present = ", ".join([*found, *sorted(others)]) or "nothing"
    return RecordedMotion(
        _chosen(path, streams, POSES, pose_topic, ("poses", "--poses"), present),
        _chosen(path, streams, commands, command_topic, ("commands", "--commands"), present),
    )


def _stamp_us(kind: _Kind, message: Any, recorded_us: int) -> int:
    if kind.stamp is None:
        return recorded_us
    stamp = kind.stamp(message)
    # ROS and protobuf name them differently.
    seconds = stamp.sec if hasattr(stamp, "sec") else stamp.seconds
    nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nanos
    at_us = int(seconds) * US_PER_S + int(nanoseconds) // 1000
    return at_us or recorded_us  # a stamp that nobody set


def _stream(topic: str, type_name: str, rows: list[tuple[int, tuple[float, ...]]]) -> Stream:
    rows = sorted(rows, key=lambda row: row[0])
    times = np.array([at_us for at_us, _ in rows], np.int64)
    return Stream(topic, type_name, times, np.array([values for _, values in rows], float))


def _chosen(
    path: Path,
    streams: list[Stream],
    kinds: Mapping[str, _Kind],
    topic: str | None,
    words: tuple[str, str],
    present: str,
) -> Stream:
    noun, flag = words
    suitable = [stream for stream in streams if stream.type_name in kinds]
    named = [stream for stream in suitable if topic in (None, stream.topic)]
    if not named:
        where = "no topic" if topic is None else f"{flag} {topic}: not a topic"
        raise LogError(f"{path}: {where} with {noun} ({', '.join(kinds)}); there is: {present}")
    usual = [stream for stream in named if stream.topic.rpartition("/")[2] in USUAL_COMMANDS]
    if len(named) > 1 and len(usual) == 1:
        return usual[0]
    if len(named) > 1:
        names = ", ".join(stream.topic for stream in named)
        raise LogError(f"{path}: several topics with {noun}: {names}; say which with {flag}")
    return named[0]
