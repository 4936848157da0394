"""What Foxglove draws of a lab: entities, each of which takes the place of its last."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.duration_pb2 import Duration

from koopman_lab.config.sampler import Area
from koopman_lab.config.schema import LabConfig

# The colours of the page: `offboard/viewer/page/style.css`.
ROBOT, WHEEL = Color(r=0.11, g=0.37, b=0.69, a=0.9), Color(r=0.1, g=0.1, b=0.12, a=1.0)
GOAL, PREDICTED = Color(r=0.70, g=0.15, b=0.12, a=0.9), Color(r=0.54, g=0.28, b=0.0, a=1.0)
SET, FLOOR = Color(r=0.36, g=0.42, b=0.48, a=1.0), Color(r=0.5, g=0.5, b=0.5, a=1.0)

BODY_LENGTH = 0.9
"""Assumption: of a body whose length nobody says, in track widths."""
BODY_HEIGHT_M, WHEEL_WIDTH_M = 0.06, 0.02
"""Assumptions; nothing is computed with them."""
LINE_PX = 2.0
PREDICTION_LIFETIME_S = 1
"""So long a prediction is shown after the controller fell silent."""
UPRIGHT = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
LYING = Quaternion(x=math.sqrt(0.5), y=0.0, z=0.0, w=math.sqrt(0.5))
"""Turns what stands along z so that it lies along y, as a wheel's axle does."""


def lab(robot_name: str, frame: str, config: LabConfig) -> list[Any]:
    """Return what stays as long as the configuration does.

    Parameters
    ----------
    robot_name
        Names the robot's frame, and the entities.
    frame
        The inertial frame.
    config
        Has the robot's size, the floor and the sets.
    """
    sampler = config.sampler
    return [
        body(robot_name, config.robot.wheel_radius_m, config.robot.track_width_m),
        _outline(f"{robot_name} floor", frame, config.floor, FLOOR),
        _outline(f"{robot_name} X0", frame, sampler.draw_set, SET),
        _outline(f"{robot_name} Z", frame, sampler.admissible_set, SET),
    ]


def body(robot_name: str, wheel_radius_m: float, track_width_m: float) -> Any:
    """Return a body on two wheels, which moves with the robot's frame."""
    length_m, width_m = BODY_LENGTH * track_width_m, track_width_m - WHEEL_WIDTH_M
    diameter_m = 2.0 * wheel_radius_m
    wheels = [
        CylinderPrimitive(
            pose=_pose(0.0, side * track_width_m / 2.0, wheel_radius_m, LYING),
            size=Vector3(x=diameter_m, y=diameter_m, z=WHEEL_WIDTH_M),
            bottom_scale=1.0,
            top_scale=1.0,
            color=WHEEL,
        )
        for side in (1.0, -1.0)
    ]
    box = CubePrimitive(
        pose=_pose(0.0, 0.0, wheel_radius_m + BODY_HEIGHT_M / 2.0),
        size=Vector3(x=length_m, y=max(width_m, WHEEL_WIDTH_M), z=BODY_HEIGHT_M),
        color=ROBOT,
    )
    nose = _arrow(_pose(0.0, 0.0, wheel_radius_m + BODY_HEIGHT_M), length_m, GOAL)
    return SceneEntity(
        id=f"{robot_name} body",
        frame_id=robot_name,
        frame_locked=True,
        cubes=[box],
        cylinders=wheels,
        arrows=[nose],
    )


def goal(robot_name: str, frame: str, pose: Any) -> Any:
    """Return an arrow where a robot is to be parked."""
    return SceneEntity(id=f"{robot_name} goal", frame_id=frame, arrows=[_arrow(pose, 0.2, GOAL)])


def prediction(robot_name: str, frame: str, points: Sequence[tuple[float, float]]) -> Any:
    """Return a line through predicted positions (m, m), which goes when no next one comes."""
    return SceneEntity(
        id=f"{robot_name} predicted",
        frame_id=frame,
        lifetime=Duration(seconds=PREDICTION_LIFETIME_S),
        lines=[_line(LinePrimitive.LINE_STRIP, points, PREDICTED)] if points else [],
    )


def _outline(name: str, frame: str, area: Area, color: Any) -> Any:
    (left, right), (bottom, top) = area.x1_m, area.x2_m
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    line = _line(LinePrimitive.LINE_LOOP, corners, color)
    return SceneEntity(id=name, frame_id=frame, lines=[line])


def _line(kind: Any, points: Sequence[tuple[float, float]], color: Any) -> Any:
    return LinePrimitive(
        type=kind,
        pose=_pose(0.0, 0.0, 0.0),
        thickness=LINE_PX,
        scale_invariant=True,
        points=[Point3(x=x1, y=x2, z=0.0) for x1, x2 in points],
        color=color,
    )


def _arrow(pose: Any, length_m: float, color: Any) -> Any:
    return ArrowPrimitive(
        pose=pose,
        shaft_length=0.7 * length_m,
        shaft_diameter=0.08 * length_m,
        head_length=0.3 * length_m,
        head_diameter=0.2 * length_m,
        color=color,
    )


def _pose(x: float, y: float, z: float, orientation: Any = UPRIGHT) -> Any:
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=orientation)
