"""The whole lab in lockstep, in which nodes can be killed and the true motion is recorded."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.node import Node, Port, RawHandler, Tick
from koopman_lab.config.change import changed
from koopman_lab.config.schema import LabConfig
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.emulation.board import emulated_board
from koopman_lab.errors import LabStateError
from koopman_lab.geometry.planar import Pose
from offboard.controller.controller_step import State
from offboard.controller.node import ControllerNode
from offboard.lab.session_watch import RobotWatchNode
from offboard.logger.node import LoggerNode
from offboard.sampler.node import SamplerNode
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode

Activity = Literal["park", "calibrate"]
STEP_S = 0.01
FAST_M_PER_S = 0.25
"""The fault comes while the robot drives at least as fast."""
MOVES_M_PER_S = 0.02
"""If a wheel is faster than this, the robot moves, however slowly."""
MOVING_LIMIT_S = 30.0
START = Pose(-1.8, 0.3, 0.0)
"""Far enough from the goal that parking is not over before the scenario is."""
START_ASKEW = Pose(-1.8, 0.3, 0.6)
"""Along an axis of the frame some wrong frames look right."""


class TruthSample(NamedTuple):
    """The true pose and velocity of the robot at one time, from PLANT_TRUTH."""

    utime: int
    x1_m: float
    x2_m: float
    theta_rad: float
    v_m_per_s: float
    omega_rad_per_s: float

    @classmethod
    def of(cls, t: lcmtypes.plant_truth_t) -> TruthSample:
        """Return the sample that a message holds."""
        return cls(t.utime, t.x1_m, t.x2_m, t.theta_rad, t.v_m_per_s, t.omega_rad_per_s)


class KillableNode:
    """A node that can die as by `kill -9`: it says nothing more, not even a last stop.

    Only the runner's own heartbeat for it goes on; no node acts on those.
    """

    def __init__(self, node: Node) -> None:
        self.name = node.name
        self.alive = True
        self.finished = False
        self.muted: set[str] = set()
        """Suffixes of channels on which nothing is said any more."""
        self._node = node

    def attach(self, port: Port) -> None:
        """Attach the node to a port that dies with it."""
        self._node.attach(_KillablePort(port, self))

    def close(self) -> None:
        """Close the node in order, if it still lives."""
        if self.alive:
            self._node.close()
            self.alive = False


class _KillablePort:
    def __init__(self, port: Port, owner: KillableNode) -> None:
        self.robot_name, self.virtual, self.process = port.robot_name, port.virtual, port.process
        self._port, self._owner = port, owner
        self.now_us, self.lost_messages = port.now_us, port.lost_messages
        self.without_key = port.without_key
        self.publishers = port.publishers

    def publish(self, channel: Channel[M], message: M) -> None:
        if self._owner.alive and channel.suffix not in self._owner.muted:
            self._port.publish(channel, message)

    def subscribe(self, channel: Channel[M], handler: Callable[[M], None]) -> None:
        self._port.subscribe(channel, lambda m: handler(m) if self._owner.alive else None)

    def subscribe_raw(self, channel: Channel[M], handler: RawHandler) -> None:
        self._port.subscribe_raw(channel, lambda *m: handler(*m) if self._owner.alive else None)

    def every(self, rate_hz: float, tick: Tick) -> None:
        self._port.every(rate_hz, lambda t: tick(t) if self._owner.alive else None)

    def finish(self) -> None:
        self._owner.finished = True


class Witness:
    """A node that records the true motion."""

    name = "witness"

    def __init__(self) -> None:
        self.sights: list[TruthSample] = []

    def attach(self, port: Port) -> None:
        """Listen to PLANT_TRUTH."""
        port.subscribe(channels.PLANT_TRUTH, self._on_truth)

    def close(self) -> None:
        """Nothing is held."""

    def _on_truth(self, t: lcmtypes.plant_truth_t) -> None:
        self.sights.append(TruthSample.of(t))


class Stage:
    """Plant, onboard loop, logger and a commander on their way.

    Parameters
    ----------
    config
        The lab.
    activity
        Who commands: the controller (with the nominal model) or the sampler.
    log
        File for the session log.
    wrong
        What is wrong from the beginning, if anything is.
    """

    def __init__(
        self, config: LabConfig, activity: Activity, log: Path, wrong: Sequence[Fault] = ()
    ) -> None:
        from koopman_lab.predictors.nominal import NominalPrediction

        config.require_simulation()
        if wrong:
            faults = tuple(PlannedFault(at_s=0.0, **fault.model_dump()) for fault in wrong)
            config = changed(config, "simulation", faults=faults)
        if activity == "park":
            config = changed(
                config, "simulation.plant", initial_pose=tuple(START_ASKEW if wrong else START)
            )
        self.config = config
        self.lab = Lockstep(config)
        self.onboard = OnboardNode(config)
        self.witness = Witness()
        self.message = ""
        """The message with which the session ended."""
        self.ended_us: int | None = None
        """When it did."""
        self.states: list[str] = []
        """Of the motor loop, one after another."""
        prediction = NominalPrediction(config.robot.kind, config.controller.dt_s)
        self.commander: ControllerNode | SamplerNode = (
            ControllerNode(config, prediction) if activity == "park" else SamplerNode(config)
        )
        self._logger = LoggerNode(config, log)
        nodes: tuple[Node, ...] = (self.onboard, self._logger, self.commander)
        self.killable = {node.name: KillableNode(node) for node in nodes}
        self.lab.add(PlantNode(config))
        for node_of_stage in self.killable.values():
            board = node_of_stage.name == self.onboard.name
            self.lab.add(node_of_stage, emulated_board(config) if board else None)
        self.lab.add(RobotWatchNode(config))
        self.lab.add(self.witness)

    def run(self, seconds: float) -> None:
        """Go on, and end the session where it ends itself or the watch ends it."""
        commander = self.killable[self.commander.name]
        for _ in range(round(seconds / STEP_S)):
            try:
                self.lab.run(STEP_S)
            except LabStateError as error:
                self._end(commander, str(error))
            if commander.finished and commander.alive:
                self._end(commander, self._outcome())
            self._note_state()

    def until_fast(self) -> None:
        """Go on until the robot drives fast.

        Raises
        ------
        LabStateError
            If it does not.
        """
        for _ in range(round(MOVING_LIMIT_S / STEP_S)):
            self.run(STEP_S)
            if self.witness.sights and self.witness.sights[-1].v_m_per_s >= FAST_M_PER_S:
                self.states.clear()
                return
        raise LabStateError(f"the robot has not reached {FAST_M_PER_S:g} m/s")

    def until_moving(self) -> None:
        """Go on until the robot moves, or has had time enough to."""
        half_track_m = 0.5 * self.config.robot.track_width_m
        for _ in range(round(MOVING_LIMIT_S / STEP_S)):
            self.run(STEP_S)
            for sight in self.witness.sights[-1:]:
                rim_m_per_s = abs(sight.v_m_per_s) + half_track_m * abs(sight.omega_rad_per_s)
                if rim_m_per_s >= MOVES_M_PER_S:
                    self.states.clear()
                    return
        self.states.clear()

    def kill(self, name: str) -> None:
        """Let a node die."""
        self.killable[name].alive = False
        if name == self._logger.name:
            # As the system does with the files of a process that is gone.
            self._logger.close()

    def join(self, node: Node) -> None:
        """Let somebody else come onto the bus."""
        self.lab.add(node)

    def close(self) -> None:
        """Close all nodes."""
        self.lab.close()

    @property
    def session(self) -> str:
        """Return whether the session waits or goes on, has ended, or its process has died."""
        if self.killable[self.commander.name].alive:
            return "waits" if self._waits_for else "goes on"
        return "has ended" if self.message else "has died, which the supervisor says"

    @property
    def told(self) -> str:
        """Return what the operator has read at the end, or reads of what is waited for."""
        return self.message or self._waits_for

    @property
    def _waits_for(self) -> str:
        """Return what a commander that has not begun waits for; empty if it has."""
        commander = self.commander
        if isinstance(commander, SamplerNode):
            waits_for = commander.sampler.waits_for
            return "" if waits_for is None else waits_for.reason
        drive = commander.controller
        return drive.reason if drive.state is State.WAIT else ""

    def _end(self, commander: KillableNode, message: str) -> None:
        if self.ended_us is None:
            self.message, self.ended_us = message, self.lab.now_us
        commander.close()

    def _outcome(self) -> str:
        if isinstance(self.commander, SamplerNode):
            reason = self.commander.outcome().reason
            return f"ended: {reason}" if reason else "all segments recorded"
        outcome = self.commander.outcome()
        return "parked" if outcome.parked else f"not parked ({outcome.reason})"

    def _note_state(self) -> None:
        loop = self.onboard.loop
        fault = f" {loop.fault.name}" if loop.fault else ""
        state = f"{loop.state.name}{fault}"
        if self.states[-1:] != [state]:
            self.states.append(state)


def is_at_rest(sight: TruthSample) -> bool:
    """Return whether the robot stands: slower than 1 mm/s and 0.01 rad/s."""
    return abs(sight.v_m_per_s) < 1e-3 and abs(sight.omega_rad_per_s) < 1e-2


def rolled_m(sights: list[TruthSample]) -> float:
    """Return the length of the way (m)."""
    return sum(math.hypot(b.x1_m - a.x1_m, b.x2_m - a.x2_m) for a, b in pairwise(sights))
