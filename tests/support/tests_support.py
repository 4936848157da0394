"""Pieces that several tests drive the real components with."""

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from koopman_lab.emulation.board import emulated_board
from koopman_lab.geometry.planar import Pose
from offboard.desk.commander import Commands
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode


def lab_of(config, *nodes, start_us=0):
    """Return nodes in lockstep, the motor loop on a simulated board."""
    lab = Lockstep(config, start_us)
    for node in nodes:
        lab.add(node, emulated_board(config) if node.name == "onboard" else None)
    return lab


class Script:
    """Commands the same input all the time."""

    name = "controller"

    def __init__(self, config, u):
        self._config, self._u = config, u

    def attach(self, port):
        self._port = port
        self._commands = Commands(port, self._config, self.name)
        self.first_us = None
        port.subscribe(channels.MOTOR_CMD, lambda _: None)
        port.every(1.0 / self._config.controller.dt_s, self._tick)

    def _tick(self, tick_us):
        self._commands.send(self._u, tick_us)

    def close(self):
        pass


def ideal_run(robot: str, u: tuple[float, float], seconds: float) -> tuple[Pose, float]:
    """Drive the ideal plant through the real onboard loop; return pose and seconds of motion."""
    config = load_config(robot=robot, preset="ideal")
    plant = PlantNode(config)
    lockstep = lab_of(config, plant, OnboardNode(config), Script(config, u))
    lockstep.run(seconds)
    plant.plant.advance(lockstep.now_us)
    # The command sent at time 0 reaches the motors in the onboard tick 10 ms later.
    return plant.plant.pose, seconds - 0.01


class DutyScript:
    """Stands in for the motor loop: gives the motors the same duties all the time."""

    name = "duties"

    def __init__(self, duties):
        self._message = lcmtypes.motor_command_t()
        self._message.left_duty, self._message.right_duty = duties

    def attach(self, port):
        def tick(tick_us):
            self._message.utime = tick_us
            port.publish(channels.MOTOR_CMD, self._message)

        port.every(100.0, tick)

    def close(self):
        pass


class Eye:
    """Keeps what the cameras and the encoders say, and what is true."""

    name = "eye"

    def __init__(self):
        self.frames, self.encoders, self.truths = [], [], []

    def attach(self, port):
        port.subscribe(channels.MOCAP_POSE, self.frames.append)
        port.subscribe(channels.ENCODER, self.encoders.append)
        port.subscribe(channels.PLANT_TRUTH, self.truths.append)
        port.every(1.0, lambda _: None)

    def close(self):
        pass
