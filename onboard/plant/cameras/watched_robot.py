"""Simulated cameras in a process of their own, which see a robot that another process moves."""

from __future__ import annotations

from collections.abc import Callable

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.age import is_current
from koopman_lab.bus.node import Port
from koopman_lab.bus.stamp_gate import StampGate
from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.faults import KINDS
from koopman_lab.geometry.planar import PlainPose, Pose, move_along_arc
from koopman_lab.units import US_PER_S
from onboard.plant.cameras.node import SimulatedCameras

OLDEST_TRUTH_US = 500_000
"""Older news of the robot's motion show nothing: who moves it is gone."""
OCCLUSION = 1 << KINDS.index("occlusion")


class WatchedRobot:
    """The robot as PLANT_TRUTH tells of it: a :class:`~onboard.plant.cameras.node.Scene`.

    Between two messages it is taken to go on along the arc of its newest speeds.
    """

    def __init__(self) -> None:
        self.after_tick: list[Callable[[int], None]] = []
        """Called with the time (us) of each message."""
        self._truth: lcmtypes.plant_truth_t | None = None
        self._gate = StampGate(channels.PLANT_TRUTH)

    def attach(self, port: Port) -> None:
        """Listen to PLANT_TRUTH."""
        port.subscribe(channels.PLANT_TRUTH, lambda truth: self.take(truth, port.now_us()))

    def look(self, now_us: int) -> tuple[int, PlainPose, bool]:
        """Return this time (us), the pose (m, m, rad) at it, and whether nothing can be seen.

        That is so while the robot is covered, and while nobody tells of it.
        """
        truth = self._truth
        if truth is None or not is_current(truth.utime, now_us, OLDEST_TRUTH_US):
            return now_us, (0.0, 0.0, 0.0), True
        passed_s = (now_us - truth.utime) / US_PER_S
        before = Pose(truth.x1_m, truth.x2_m, truth.theta_rad)
        pose = move_along_arc(before, truth.v_m_per_s * passed_s, truth.omega_rad_per_s * passed_s)
        return now_us, pose, bool(truth.faults & OCCLUSION)

    def take(self, truth: lcmtypes.plant_truth_t, now_us: int) -> None:
        """Take news of the robot that arrive now (us); those that are not of now tell nothing."""
        if not self._gate.admits(truth.utime, now_us):
            return
        self._truth = truth
        for call in self.after_tick:
            call(truth.utime)


class CameraBridge:
    """Listens to PLANT_TRUTH; speaks MOCAP_POSE, as the plant's own cameras do.

    Parameters
    ----------
    config
        The lab; something must be simulated.
    """

    name = "mocap"

    def __init__(self, config: LabConfig) -> None:
        self._robot = WatchedRobot()
        self._cameras = SimulatedCameras(config, self._robot)

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._robot.attach(port)
        self._cameras.attach(port)

    def close(self) -> None:
        """Nothing is held."""
