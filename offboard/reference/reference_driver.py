"""Reference runs as a state machine: place, settle, drive the inputs in open loop, stop, again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose
from koopman_lab.units import US_PER_S
from offboard.desk.interlock import TO_BE_MENDED, Interlock
from offboard.desk.placing import stands_at

ASK_AGAIN_S = 1.0
"""Placing is asked for again after this time, should the message be lost."""
STANDING_S = 0.25
"""Longer than the delay of what the motor loop reports, so that it may be believed."""


class Phase(IntEnum):
    """Of the session; the numbers are those of ``reference_state_t``."""

    WAIT = 0
    PLACE = 1
    SETTLE = 2
    RUN = 3
    STOP = 4
    DONE = 5


class Observation(NamedTuple):
    """What the driver sees in a step.

    ``pose`` is None while tracking is lost, otherwise of the frame at ``pose_us`` (us);
    ``interlock`` is why the robot must not be driven, None if it may be.
    ``holding`` says that the motor loop obeys this commander, ``free`` that it obeys nobody and
    aims at rest.
    """

    pose: Pose | None
    pose_us: int
    interlock: Interlock | None
    holding: bool
    free: bool

    @property
    def ready(self) -> bool:
        """Return whether nothing forbids driving."""
        return self.interlock is None


class Action(NamedTuple):
    """What to do in a control interval.

    ``u`` is the input to command, None for no command; ``release`` gives the robot up; ``place``
    asks for it to be placed. ``run`` and ``step`` count in phase RUN.
    """

    phase: Phase
    run: int
    step: int
    u: tuple[float, float] | None = None
    release: bool = False
    place: bool = False


class ReferenceDriver:
    """Drives one sequence of inputs again and again (paper, section 5.3).

    Each run begins at rest, within placement accuracy of the same pose. A run that is cut off is
    driven again; what a person has to mend ends the session.

    Parameters
    ----------
    config
        Accuracy of placing and times.
    start
        Where the robot is placed.
    inputs
        Of a run, one for each control interval; they end at rest.
    runs
        How many.
    """

    def __init__(
        self,
        config: LabConfig,
        start: Pose,
        inputs: Sequence[tuple[float, float]],
        runs: int,
    ) -> None:
        self.phase = Phase.WAIT
        self.start = start
        self.inputs = inputs
        self.total = runs
        self.done = 0
        self.begun = 0
        self.repeated: Counter[str] = Counter()
        self.reason = ""
        """Why the session ended before all runs were driven."""
        self._accuracy = config.placement
        self._settle_us = round(config.reference.settle_s * US_PER_S)
        self._since_us = 0
        self._asked_us: int | None = None
        self._step = 0

    def step(self, seen: Observation, now_us: int) -> Action:
        """Return what to do in the next control interval."""
        if seen.interlock is not None and seen.interlock.ends_session and not self.reason:
            self.reason = seen.interlock.reason
            if self.phase not in (Phase.RUN, Phase.STOP, Phase.DONE):
                self._enter(Phase.STOP, now_us)
        if self.phase is Phase.WAIT and seen.ready:
            self._enter(Phase.PLACE, now_us)
        if self.phase is Phase.STOP and self._has_stopped(seen, now_us):
            ended = self.done == self.total or self.reason
            self._enter(Phase.DONE if ended else Phase.PLACE, now_us)
        if self.phase is Phase.PLACE and self._is_placed(seen):
            self._enter(Phase.SETTLE, now_us)
        if self.phase is Phase.SETTLE:
            if not seen.ready or not self._stands(seen):
                self._enter(Phase.PLACE, now_us)
            elif now_us - self._since_us >= self._settle_us and seen.holding:
                self._enter(Phase.RUN, now_us)
        if self.phase is Phase.RUN:
            return self._run(seen, now_us)
        if self.phase is Phase.SETTLE:
            return self._action(u=(0.0, 0.0))
        if self.phase is Phase.PLACE:
            return self._place(now_us)
        return self._action(release=self.phase is not Phase.WAIT)

    def _run(self, seen: Observation, now_us: int) -> Action:
        number, step = self.begun, self._step
        if step == len(self.inputs):
            self.done += 1
        elif seen.interlock is not None:
            self.repeated[seen.interlock.reason] += 1
            if seen.interlock.cause in TO_BE_MENDED:
                self.reason = seen.interlock.reason
        elif not seen.holding:
            self.repeated["robot taken away"] += 1
        else:
            self._step += 1
            return Action(Phase.RUN, number, step, self.inputs[step])
        self.begun += 1
        self._enter(Phase.STOP, now_us)
        return self._action(release=True)

    def _place(self, now_us: int) -> Action:
        asks = self._asked_us is None or now_us - self._asked_us >= ASK_AGAIN_S * US_PER_S
        if asks:
            self._asked_us = now_us
        return self._action(release=True, place=asks)

    def _is_placed(self, seen: Observation) -> bool:
        asked_us = self._asked_us
        return asked_us is not None and seen.pose_us > asked_us and self._stands(seen)

    def _stands(self, seen: Observation) -> bool:
        return seen.pose is not None and stands_at(seen.pose, self.start, self._accuracy)

    def _has_stopped(self, seen: Observation, now_us: int) -> bool:
        rested = now_us - self._since_us >= STANDING_S * US_PER_S
        if seen.interlock is not None and seen.interlock.ends_session:
            return rested  # what the robot does is no more this session's affair
        # Whatever forbids driving, a robot that nobody holds and that aims at rest has stopped.
        return rested and seen.free and (seen.ready or bool(self.reason))

    def _enter(self, phase: Phase, now_us: int) -> None:
        self.phase = phase
        self._since_us = now_us
        self._asked_us = None
        self._step = 0

    def _action(
        self,
        u: tuple[float, float] | None = None,
        *,
        release: bool = False,
        place: bool = False,
    ) -> Action:
        return Action(self.phase, self.begun, self._step, u, release, place)
