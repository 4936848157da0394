"""The lab in 3D for Foxglove, in its own schemas, from the messages of the lab.

Of a robot R1 there are

- ``/tf``: ``foxglove.FrameTransform``, where the tracked frame ``R1`` is in the frame ``lab``;
- ``/R1/pose``: ``foxglove.PoseInFrame``, the same as a pose;
- ``/R1/path``: ``foxglove.PosesInFrame``, where it was in the last half minute;
- ``/R1/goal``: ``foxglove.PoseInFrame``, where it is to be parked, whenever that changes;
- ``/R1/scene``: ``foxglove.SceneUpdate``, its body, the floor, the sets X0 and Z, the goal, and the
  positions that the controller predicts.

``lab`` is the inertial frame: x1 is x, x2 is y, theta turns about z, which points up. Poses
that the cameras call invalid, and numbers that are none, are left out.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.schema import build_file_descriptor_set

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import MOCAP_POSE, MPC_STATE, SESSION_INFO
from koopman_lab.config.load import load_config, parse_config
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.formats import scene_entities
from koopman_lab.data.formats.decoded import seconds_and_nanoseconds, turn_about_z
from koopman_lab.errors import LabError
from koopman_lab.geometry.planar import PlainPose
from koopman_lab.units import US_PER_S

LAB = "lab"
"""The inertial frame."""
PATH_S = 30.0
PATH_STEP_US = 100_000
PATH_PERIOD_US = US_PER_S
"""The path holds a pose every 0.1 s of the last 30 s, and is said once a second: 20 kB."""
LATEST_S = 253_402_300_799
"""The last second that protobuf's Timestamp can hold."""


class Shown(NamedTuple):
    """A message of Foxglove's schemas, and its topic."""

    topic: str
    message: Any


class Scene:
    """All robots of a log, or of a bus."""

    def __init__(self) -> None:
        self._robots: dict[str, _Robot] = {}

    def take(self, robot_name: str, channel: Channel[Any], message: Any) -> list[Shown]:
        """Return what to show when a robot's message arrives."""
        robot = self._robots.get(robot_name)
        if robot is None:
            robot = self._robots[robot_name] = _Robot(robot_name)
        if channel is MOCAP_POSE:
            return list(robot.take_pose(message))
        if channel is MPC_STATE:
            return list(robot.take_step(message))
        if channel is SESSION_INFO:
            return list(robot.take_config(message))
        return []

    def still(self, utime: int) -> list[Shown]:
        """Return at a time (us) once more what stays, for who did not see it when it was shown."""
        return [shown for robot in self._robots.values() for shown in robot.still(utime)]


def schema_of(message: Any) -> tuple[str, str, bytes]:
    """Return name, encoding and data of the schema of a protobuf message, as MCAP has them."""
    descriptors = build_file_descriptor_set(type(message))
    return message.DESCRIPTOR.full_name, "protobuf", descriptors.SerializeToString()


class _Robot:
    def __init__(self, name: str) -> None:
        self._name = name
        self._config: LabConfig | None = None
        self._config_yaml = ""
        self._drawn = False
        self._path: deque[tuple[int, PlainPose]] = deque()
        self._path_due_us: int | None = None
        self._goal: tuple[float, ...] | None = None

    def take_pose(self, message: Any) -> Iterator[Shown]:
        pose = message.x1_m, message.x2_m, message.theta_rad
        if not message.tracking_valid or not all(map(math.isfinite, pose)):
            return
        at = timestamp(message.utime)
        if not self._drawn:
            yield self._draw(at)
        placed = foxglove_pose(pose)
        yield Shown(
            "/tf",
            FrameTransform(
                timestamp=at,
                parent_frame_id=LAB,
                child_frame_id=self._name,
                translation=placed.position,
                rotation=placed.orientation,
            ),
        )
        yield self._shown("pose", PoseInFrame(timestamp=at, frame_id=LAB, pose=placed))
        if self._extend_path(message.utime, pose):
            poses = [foxglove_pose(before) for _, before in self._path]
            yield self._shown("path", PosesInFrame(timestamp=at, frame_id=LAB, poses=poses))

    def take_step(self, message: Any) -> Iterator[Shown]:
        at, goal = timestamp(message.utime), tuple(message.goal)
        if goal != self._goal and all(map(math.isfinite, goal)):
            self._goal = goal
            yield from self._show_goal(at, goal)
        points = zip(message.predicted_x1_m, message.predicted_x2_m, strict=True)
        predicted = [point for point in points if all(map(math.isfinite, point))]
        yield self._scene(at, [scene_entities.prediction(self._name, LAB, predicted)])

    def still(self, utime: int) -> Iterator[Shown]:
        at = timestamp(utime)
        if self._drawn:
            yield self._draw(at)
        if self._goal is not None:
            yield from self._show_goal(at, self._goal)

    def take_config(self, message: Any) -> Iterator[Shown]:
        if message.config_yaml == self._config_yaml:
            return
        self._config_yaml = message.config_yaml
        try:
            self._config = parse_config(message.config_yaml, SESSION_INFO.name(self._name))
        except LabError:  # of a version that had other keys: the lab is drawn as the defaults say
            return
        yield self._draw(timestamp(message.utime))

    def _draw(self, at: Timestamp) -> Shown:
        """Draw what stays: body, floor and sets, as the session says, or else the defaults."""
        self._drawn = True
        if self._config is None:
            self._config = load_config()
        return self._scene(at, scene_entities.lab(self._name, LAB, self._config))

    def _show_goal(self, at: Timestamp, goal: tuple[float, ...]) -> Iterator[Shown]:
        placed = foxglove_pose(goal)
        yield self._shown("goal", PoseInFrame(timestamp=at, frame_id=LAB, pose=placed))
        yield self._scene(at, [scene_entities.goal(self._name, LAB, placed)])

    def _scene(self, at: Timestamp, entities: list[Any]) -> Shown:
        for entity in entities:
            entity.timestamp.CopyFrom(at)
        return self._shown("scene", SceneUpdate(entities=entities))

    def _extend_path(self, utime: int, pose: PlainPose) -> bool:
        """Take a pose; return whether the path is to be shown again."""
        path = self._path
        if path and 0 <= utime - path[-1][0] < PATH_STEP_US:
            return False
        if path and not 0 <= utime - path[-1][0] <= PATH_S * US_PER_S:
            path.clear()  # another session, or a clock that was set
        path.append((utime, pose))
        while utime - path[0][0] > PATH_S * US_PER_S:
            path.popleft()
        due_us = self._path_due_us
        if due_us is not None and due_us - PATH_PERIOD_US <= utime < due_us:
            return False
        self._path_due_us = utime + PATH_PERIOD_US
        return True

    def _shown(self, topic: str, message: Any) -> Shown:
        return Shown(f"/{self._name}/{topic}", message)


def timestamp(utime: int) -> Timestamp:
    """Return a time (us) as protobuf has it, as near as it can hold it, from 1970 on."""
    seconds, nanos = seconds_and_nanoseconds(utime, LATEST_S)
    return Timestamp(seconds=seconds, nanos=nanos)


def foxglove_pose(pose: Sequence[float]) -> Pose:
    """Return a planar pose (m, m, rad) in space, on the floor."""
    x1, x2, theta = pose
    z, w = turn_about_z(theta)
    return Pose(position=Vector3(x=x1, y=x2, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=z, w=w))
