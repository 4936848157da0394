"""The plant with what goes wrong with its motors, counters and battery."""

from __future__ import annotations

from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.faults import NO_EFFECTS, Effects, Faults
from onboard.plant.counters import Counters, Counts
from onboard.plant.driver_watchdog import DriverWatchdog
from onboard.plant.plant import Plant
from onboard.plant.wiring import AS_INTENDED, encoder_wiring, motor_wiring


class FaultyPlant:
    """Motor drivers with a watchdog of their own, and faults on demand; times are those of the bus.

    Parameters
    ----------
    config
        What goes wrong by itself, and the drivers' patience.
    plant
        What is driven.
    start_us
        Present time (us).
    """

    def __init__(self, config: LabConfig, plant: Plant, start_us: int) -> None:
        simulation = config.require_simulation()
        self.faults = Faults(simulation.faults, start_us)
        self.effects = NO_EFFECTS
        """What is wrong at the time to which the plant was last advanced."""
        self.occluded = False
        """Whether somebody stands between the robot and the cameras."""
        self._plant = plant
        self._motors = self._encoders = AS_INTENDED
        self._counters = Counters()
        self._watchdog = DriverWatchdog(simulation.plant.motor.command_timeout_s)

    def drive(self, left_duty: float, right_duty: float, now_us: int) -> None:
        """Apply motor duties from now on."""
        self.advance(now_us)
        self._watchdog.hear(now_us)
        if self._motors != AS_INTENDED:
            left_duty, right_duty = self._motors.to_parts(left_duty, right_duty)
        self._plant.drive(left_duty, right_duty)

    def advance(self, now_us: int) -> int:
        """Take the plant to ``now_us``; return where it is, since it never runs backwards."""
        plant = self._plant
        if now_us >= self._watchdog.due_us:
            plant.advance(self._watchdog.brake())
            plant.drive(0.0, 0.0)
        at_us = plant.advance(now_us)
        if now_us >= self.faults.change_us:
            self._feel(self.faults.at(now_us))
        return at_us

    def encoder_counts(self) -> Counts:
        """Return what both encoder counters show."""
        return self._counters.read(self._plant.encoder_counts(), self._encoders)

    def _feel(self, effects: Effects) -> None:
        self.effects = effects
        self.occluded = effects.includes("occlusion")
        self._motors, self._encoders = motor_wiring(effects), encoder_wiring(effects)
        self._plant.drives.stall(*effects.motor_stalled)
        self._plant.drives.feed(effects.battery_v)
