"""Ties motors, body and encoders of the plant to the bus; a real robot replaces exactly this."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import PlainPose, Pose
from onboard.plant.faulty_plant import FaultyPlant
from onboard.plant.plant import Plant


class SimulatedRobot:
    """Listens to MOTOR_CMD, PLANT_RESET, FAULT; speaks ENCODER and PLANT_TRUTH.

    Parameters
    ----------
    config
        The lab; something must be simulated.
    """

    name = "plant"

    def __init__(self, config: LabConfig) -> None:
        # The first of the two generators of a plant; the other one is its cameras'.
        placement = np.random.SeedSequence([config.seed, 1], spawn_key=(0,))
        self.plant = Plant(config, np.random.default_rng(placement))
        self.after_tick: list[Callable[[int], None]] = []
        """Called with the time (us) after each encoder tick."""
        self._config = config
        # Encoded as soon as they are filled, so that one of each kind does.
        self._encoder = lcmtypes.encoder_t()
        self._truth = lcmtypes.plant_truth_t()

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._faulty_plant = FaultyPlant(self._config, self.plant, port.now_us())
        port.subscribe(channels.FAULT, self._on_fault)
        port.subscribe(channels.MOTOR_CMD, self._on_motor_command)
        port.subscribe(channels.PLANT_RESET, self._on_reset)
        rate_hz = self._config.require_simulation().plant.encoder_rate_hz
        port.every(rate_hz, self._on_encoder_tick)

    def close(self) -> None:
        """Nothing is held."""

    def look(self, now_us: int) -> tuple[int, PlainPose, bool]:
        """Move on to ``now_us`` and return what there is to see for the cameras beside the robot.

        It is what :class:`onboard.plant.cameras.node.Scene` says.
        """
        faulty_plant = self._faulty_plant
        return faulty_plant.advance(now_us), self.plant.coordinates, faulty_plant.occluded

    def _on_motor_command(self, message: lcmtypes.motor_command_t) -> None:
        self._faulty_plant.drive(message.left_duty, message.right_duty, self._port.now_us())

    def _on_fault(self, message: lcmtypes.fault_t) -> None:
        self._faulty_plant.faults.obey(message, self._port.now_us())

    def _on_reset(self, message: lcmtypes.plant_reset_t) -> None:
        self._faulty_plant.advance(self._port.now_us())
        self.plant.place(Pose(message.x1_m, message.x2_m, message.theta_rad))

    def _on_encoder_tick(self, tick_us: int) -> None:
        utime = self._faulty_plant.advance(tick_us)
        encoder = self._encoder
        encoder.utime = utime
        encoder.left_count, encoder.right_count = self._faulty_plant.encoder_counts()
        encoder.battery_v = self.plant.battery_v()
        self._port.publish(channels.ENCODER, encoder)
        self._send_truth(utime)
        for call in self.after_tick:
            call(utime)

    def _send_truth(self, utime: int) -> None:
        truth = self._truth
        truth.utime = utime
        truth.x1_m, truth.x2_m, truth.theta_rad = self.plant.coordinates
        truth.v_m_per_s, truth.omega_rad_per_s = self.plant.body_velocity()
        truth.faults = self._faulty_plant.effects.kinds
        self._port.publish(channels.PLANT_TRUTH, truth)
