"""Ties the plant to the bus; a real robot and real cameras replace exactly this node."""

from __future__ import annotations

import numpy as np

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.node import Port
from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.faults import fault_of
from koopman_lab.geometry.planar import Pose
from onboard.plant.cameras import Cameras
from onboard.plant.hardware import Hardware
from onboard.plant.plant import Plant


class PlantNode:
    """Listens to MOTOR_CMD, PLANT_RESET, FAULT; speaks ENCODER, MOCAP_POSE and PLANT_TRUTH."""

    name = "plant"

    def __init__(self, config: LabConfig) -> None:
        placement, noise = np.random.SeedSequence([config.seed, 1]).spawn(2)
        self.plant = Plant(config, np.random.default_rng(placement))
        self._cameras = Cameras(config.mocap, np.random.default_rng(noise))
        self._config = config
        # Encoded as soon as they are filled, so that one of each kind does.
        self._encoder = lcmtypes.encoder_t()
        self._truth = lcmtypes.plant_truth_t()
        self._seen = lcmtypes.mocap_pose_t()

    def attach(self, port: Port) -> None:
        """Register channels and timers."""
        self._port = port
        self._hardware = Hardware(self._config, self.plant, port.now_us())
        port.subscribe(channels.FAULT, self._on_fault)
        port.subscribe(channels.MOTOR_CMD, self._on_motor_command)
        port.subscribe(channels.PLANT_RESET, self._on_reset)
        port.every(self._config.plant.encoder_rate_hz, self._on_encoder_tick)
        port.every(self._config.mocap.rate_hz, self._on_camera_tick)

    def close(self) -> None:
        """Nothing is held."""

    def _on_motor_command(self, message: lcmtypes.motor_command_t) -> None:
        self._hardware.drive(message.left_duty, message.right_duty, self._port.now_us())

    def _on_fault(self, message: lcmtypes.fault_t) -> None:
        fault = fault_of(message)
        if fault is not None:
            self._hardware.faults.inject(fault, self._port.now_us())

    def _on_reset(self, message: lcmtypes.plant_reset_t) -> None:
        self._hardware.advance(self._port.now_us())
        self.plant.place(Pose(message.x1_m, message.x2_m, message.theta_rad))

    def _on_encoder_tick(self, tick_us: int) -> None:
        utime = self._hardware.advance(tick_us)
        encoder = self._encoder
        encoder.utime = utime
        encoder.left_count, encoder.right_count = self._hardware.encoder_counts()
        encoder.battery_v = self.plant.battery_v()
        self._port.publish(channels.ENCODER, encoder)
        self._send_truth(utime)
        self._send_frames(utime)

    def _on_camera_tick(self, tick_us: int) -> None:
        utime = self._hardware.advance(tick_us)
        self._cameras.expose(utime, self.plant.coordinates, hidden=self._hardware.effects.occluded)
        self._send_frames(utime)

    def _send_frames(self, now_us: int) -> None:
        # Asked at every tick of either timer, since frames become ready between exposures.
        seen = self._seen
        for seen.utime, pose, seen.tracking_valid in self._cameras.ready(now_us):
            seen.x1_m, seen.x2_m, seen.theta_rad = pose
            self._port.publish(channels.MOCAP_POSE, seen)

    def _send_truth(self, utime: int) -> None:
        truth = self._truth
        truth.utime = utime
        truth.x1_m, truth.x2_m, truth.theta_rad = self.plant.coordinates
        truth.v_m_per_s, truth.omega_rad_per_s = self.plant.body_velocity()
        truth.faults = self._hardware.effects.kinds
        self._port.publish(channels.PLANT_TRUTH, truth)
