"""The plant: a simulated robot, and the simulated cameras that look at it, in one process."""

from __future__ import annotations

from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from onboard.plant.cameras.node import SimulatedCameras
from onboard.plant.simulated_robot import SimulatedRobot


class PlantNode:
    """Stands in for hardware; the cameras expose the true pose of the robot beside them.

    Parameters
    ----------
    config
        The lab; something must be simulated.
    cameras
        Whether there are cameras; without them, somebody else speaks MOCAP_POSE.
    """

    name = "plant"

    def __init__(self, config: LabConfig, *, cameras: bool = True) -> None:
        robot = SimulatedRobot(config)
        self.plant = robot.plant
        self._parts = (robot, SimulatedCameras(config, robot)) if cameras else (robot,)

    def attach(self, port: Port) -> None:
        """Let both parts register channels and timers."""
        for part in self._parts:
            part.attach(port)

    def close(self) -> None:
        """Close both parts."""
        for part in self._parts:
            part.close()
