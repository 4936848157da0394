"""Places the robot: the plant by message, a real one by asking for a hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, PLANT_RESET
from koopman_lab.bus.realtime import Listener
from koopman_lab.bus.stamp_gate import StampGate
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose
from koopman_lab.units import US_PER_S
from offboard.desk.placing import reset_message, stands_at

TRIES = 20
FRAMES_PER_TRY = 60
SILENT_S = 1.0


def place(listener: Listener, config: LabConfig, start: Pose, *, by_hand: bool) -> None:
    """Place the robot at ``start`` and see by the cameras that it stands there.

    Raises
    ------
    LabStateError
        If the cameras are silent, or do not see the robot there.
    """
    frames: list[lcmtypes.mocap_pose_t] = []
    gate = StampGate(MOCAP_POSE)
    listener.subscribe(MOCAP_POSE, frames.append)
    for _ in range(1 if by_hand else TRIES):
        asked_us = listener.now_us()
        if not by_hand:
            listener.publish(PLANT_RESET, reset_message(start, asked_us))
        frames.clear()
        frame_count, newest_us = 0, asked_us
        while len(frames) < FRAMES_PER_TRY:
            listener.spin(SILENT_S / 4.0)
            now_us = listener.now_us()
            if len(frames) > frame_count:
                frame_count, newest_us = len(frames), now_us
            # Heartbeats go on when the cameras do not, so it is their silence that counts.
            elif now_us - newest_us > SILENT_S * US_PER_S:
                raise LabStateError(
                    f"{MOCAP_POSE.name(config.robot.name)}: silent; are the cameras running?"
                )
            new = [m for m in frames if m.utime > asked_us and gate.admits(m.utime, now_us)]
            if any(_shows_robot_at(frame, start, config) for frame in new):
                return
    seen = gate.complaint(listener.now_us()) or _seen_text(frames)
    remedy = "place it there by hand." if by_hand else "is another plant on this bus?"
    raise LabStateError(
        f"the cameras do not see the robot at {_text(start)}, {seen}; {remedy} Or "
        "see whether the axes of their frame and the orientation of the rigid body are right"
    )


def _seen_text(frames: Sequence[lcmtypes.mocap_pose_t]) -> str:
    """Return in words where the newest frame shows the robot."""
    tracked = [frame for frame in frames if frame.tracking_valid]
    if not tracked:
        return "they do not see it at all"
    newest = tracked[-1]
    return f"they see it at {_text(Pose(newest.x1_m, newest.x2_m, newest.theta_rad))}"


def _text(pose: Pose) -> str:
    degrees = math.degrees(pose.theta)
    return f"x1 {pose.x1:.2g} m, x2 {pose.x2:.2g} m, theta {degrees:.0f} deg"


def _shows_robot_at(frame: lcmtypes.mocap_pose_t, start: Pose, config: LabConfig) -> bool:
    pose = Pose(frame.x1_m, frame.x2_m, frame.theta_rad)
    return frame.tracking_valid and stands_at(pose, start, config.placement)
