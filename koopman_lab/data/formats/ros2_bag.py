"""A ROS 2 bag: what ROS has standard messages for, for rviz, PlotJuggler and `ros2 bag play`.

Of a robot R1 there are

- ``/tf``: ``tf2_msgs/msg/TFMessage``, where the tracked frame ``R1`` is in the frame ``lab``;
- ``/R1/pose``: ``geometry_msgs/msg/PoseStamped``, the same as a pose;
- ``/R1/cmd_vel``: ``geometry_msgs/msg/TwistStamped``, commands of a robot driven by velocities;
- ``/R1/cmd_accel``: ``geometry_msgs/msg/AccelStamped``, of one driven by accelerations;
- ``/R1/wheel_velocity``: ``geometry_msgs/msg/TwistStamped``, the velocity that the wheels show;
- ``/R1/goal``: ``geometry_msgs/msg/PoseStamped``, where it is to be parked, whenever that changes;
- ``/R1/plan``: ``nav_msgs/msg/Path``, the positions that the controller predicts.

Stamps are the messages' own, the time of a message in the bag is that of its arrival. Poses
that the cameras call invalid, and numbers that are none, are left out. The frames are those of
:mod:`~koopman_lab.data.formats.foxglove_scene`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from koopman_lab.bus.channels import (
    ACCELERATION_CMD,
    MOCAP_POSE,
    MPC_STATE,
    VELOCITY_CMD,
    WHEEL_STATE,
)
from koopman_lab.data.formats.decoded import (
    Decoded,
    Exported,
    decoded,
    nanoseconds,
    seconds_and_nanoseconds,
    turn_about_z,
)
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import replacing_folder
from koopman_lab.geometry.planar import PlainPose

LAB = "lab"
LATEST_NS = (1 << 63) - 1
LATEST_S = (1 << 31) - 1
"""A stamp of ROS keeps 32 bits of seconds, with a sign."""
BAG_VERSION: Final = 8
"""Of rosbag2 from Iron on; its messages are the same in all distributions since."""
STORAGE = StoragePlugin.MCAP
"""What `ros2 bag` writes by default since Iron."""

Ros = Iterator[tuple[str, Any]]
"""Topics, without the robot's name where they begin with ``/``, and messages of ROS."""


def write(events: Iterable[Event], folder: Path) -> Exported:
    """Write a bag, whole or not at all.

    Raises
    ------
    OSError
        If ``folder`` exists and is not empty, or cannot be written.
    LogError
        If no message has a counterpart in ROS.
    """
    written, bag_messages = Exported.nothing(), _Messages()
    with replacing_folder(folder) as temporary:
        inner = temporary / (folder.name or "bag")
        with Writer(inner, version=BAG_VERSION, storage_plugin=STORAGE) as bag:
            connections: dict[str, Any] = {}
            for entry in decoded(events, written):
                form = bag_messages.forms.get(entry.channel.suffix)
                written.keep(entry.event.channel, has_form=form is not None)
                if form is None:
                    continue
                at_ns = nanoseconds(entry.event.timestamp_us, LATEST_NS)
                for topic, message in form(entry):
                    connection = connections.get(topic)
                    if connection is None:
                        connection = connections[topic] = bag.add_connection(
                            topic, message.__msgtype__, typestore=bag_messages.store
                        )
                    data = bag_messages.store.serialize_cdr(message, message.__msgtype__)
                    bag.write(connection, at_ns, data)
            written.require_any()
        for file in list(inner.iterdir()):
            file.rename(temporary / file.name)
        inner.rmdir()
    return written


class _Messages:
    """Makes messages of ROS of those of the lab."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.LATEST)
        self.forms: dict[str, Callable[[Decoded], Ros]] = {
            MOCAP_POSE.suffix: self._pose,
            VELOCITY_CMD.suffix: self._velocity_command,
            ACCELERATION_CMD.suffix: self._acceleration_command,
            WHEEL_STATE.suffix: self._wheels,
            MPC_STATE.suffix: self._step,
        }
        self._goals: dict[str, tuple[float, ...]] = {}

    def _pose(self, entry: Decoded) -> Ros:
        message = entry.message
        pose = message.x1_m, message.x2_m, message.theta_rad
        if not message.tracking_valid or not all(map(math.isfinite, pose)):
            return
        header, placed = self._header(message.utime, LAB), self._placed(pose)
        name = _topic_word(entry.robot_name)
        translation = self._make(
            "geometry_msgs/msg/Vector3", x=placed.position.x, y=placed.position.y, z=0.0
        )
        turned = self._make(
            "geometry_msgs/msg/Transform", translation=translation, rotation=placed.orientation
        )
        transform = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=header,
            child_frame_id=name,
            transform=turned,
        )
        yield "/tf", self._make("tf2_msgs/msg/TFMessage", transforms=[transform])
        stamped = self._make("geometry_msgs/msg/PoseStamped", header=header, pose=placed)
        yield f"/{name}/pose", stamped

    def _velocity_command(self, entry: Decoded) -> Ros:
        yield from self._twist(entry, "cmd_vel")

    def _acceleration_command(self, entry: Decoded) -> Ros:
        values = entry.message.a_m_per_s2, entry.message.d_omega_rad_per_s2
        yield from self._motion(entry, "cmd_accel", "Accel", values)

    def _wheels(self, entry: Decoded) -> Ros:
        yield from self._twist(entry, "wheel_velocity")

    def _step(self, entry: Decoded) -> Ros:
        message, name = entry.message, _topic_word(entry.robot_name)
        header, goal = self._header(message.utime, LAB), tuple(message.goal)
        if goal != self._goals.get(name) and all(map(math.isfinite, goal)):
            self._goals[name] = goal
            placed = self._placed(message.goal)
            stamped = self._make("geometry_msgs/msg/PoseStamped", header=header, pose=placed)
            yield f"/{name}/goal", stamped
        if not message.horizon:
            return
        points = np.column_stack([message.predicted_x1_m, message.predicted_x2_m])
        if np.isfinite(points).all():
            poses = [
                self._make(
                    "geometry_msgs/msg/PoseStamped",
                    header=header,
                    pose=self._placed((x1, x2, heading)),
                )
                for (x1, x2), heading in zip(points.tolist(), _headings(points), strict=True)
            ]
            yield f"/{name}/plan", self._make("nav_msgs/msg/Path", header=header, poses=poses)

    def _twist(self, entry: Decoded, topic: str) -> Ros:
        values = entry.message.v_m_per_s, entry.message.omega_rad_per_s
        yield from self._motion(entry, topic, "Twist", values)

    def _motion(self, entry: Decoded, topic: str, kind: str, values: tuple[float, float]) -> Ros:
        """Give a ``Twist`` or an ``Accel`` along the robot's x axis and about z."""
        if not all(map(math.isfinite, values)):
            return
        forward, turning = values
        name, vector = _topic_word(entry.robot_name), "geometry_msgs/msg/Vector3"
        motion = self._make(
            f"geometry_msgs/msg/{kind}",
            linear=self._make(vector, x=forward, y=0.0, z=0.0),
            angular=self._make(vector, x=0.0, y=0.0, z=turning),
        )
        parts = {"header": self._header(entry.message.utime, name), kind.lower(): motion}
        yield f"/{name}/{topic}", self._make(f"geometry_msgs/msg/{kind}Stamped", **parts)

    def _placed(self, pose: PlainPose | Sequence[float]) -> Any:
        x1, x2, theta = pose
        z, w = turn_about_z(theta)
        return self._make(
            "geometry_msgs/msg/Pose",
            position=self._make("geometry_msgs/msg/Point", x=x1, y=x2, z=0.0),
            orientation=self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w),
        )

    def _header(self, utime: int, frame_id: str) -> Any:
        seconds, nanoseconds_of_it = seconds_and_nanoseconds(utime, LATEST_S)
        stamp = self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds_of_it)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _make(self, name: str, **fields: Any) -> Any:
        return self.store.types[name](**fields)


def _headings(points: Any) -> list[float]:
    """Return along which way (rad) predicted positions (N, 2) go on; the last as the one before."""
    if len(points) < 2:
        return [0.0] * len(points)
    steps = np.diff(points, axis=0)
    headings: list[float] = np.arctan2(steps[:, 1], steps[:, 0]).tolist()
    return [*headings, headings[-1]]


def _topic_word(robot_name: str) -> str:
    """Return a name as ROS takes it in topics; that of a robot on the bus may be anybody's."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", robot_name)
    return word if word[:1].isalpha() else f"r{word}"
