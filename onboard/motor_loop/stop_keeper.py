"""Writes down which stop holds the robot, so that it outlasts the program."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from koopman_lab.bus.age import is_current
from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.errors import LabStateError
from koopman_lab.units import US_PER_S
from onboard.motor_loop.health import NO_FAULT
from onboard.motor_loop.loop import MotorLoop, State
from onboard.motor_loop.stop_latch import NO_STOP

TRY_AGAIN_US = US_PER_S
"""So often a record that could not be written is tried again."""


class StopRecord(NamedTuple):
    """What is written down of a robot that was ever stopped.

    Attributes
    ----------
    number
        Of the newest stop, also where it was released: numbers go on from it.
    holds
        Whether the stop waits for its release.
    fault
        That it is; NO_FAULT for an emergency stop.
    """

    number: int
    holds: bool
    fault: Fault = NO_FAULT


class StopStore(Protocol):
    """Where the record is kept."""

    def read(self) -> StopRecord | None:
        """Return the record, None for a robot that was never stopped.

        Raises
        ------
        LabStateError
            If nobody knows whether it was, or no stop could be written down.
        """

    def write(self, record: StopRecord) -> None:
        """Write the record; it is on the disk when this returns.

        Raises
        ------
        LabStateError
            If it cannot be written.
        """


class StopKeeper:
    """Keeps the record of a motor loop as the loop is.

    Asked after each tick, when the motors have their duties, and before each status: a disk may be
    slow, and what the status says must be written down. A loop that found its encoders silent goes
    on by itself, so that is no stop that waits for anybody.

    Attributes
    ----------
    trouble
        Why the record cannot be kept, in words; empty as long as it can.
    """

    def __init__(self, loop: MotorLoop, store: StopStore) -> None:
        self.trouble = ""
        self._loop, self._store = loop, store
        self._seen = (NO_STOP, NO_FAULT)
        self._newest_number = NO_STOP
        self._kept: StopRecord | None = None
        self._tried_us = 0

    def begin(self, now_us: int) -> None:
        """Hold the robot again if a stop was not released, or if nobody knows."""
        try:
            self._kept = self._store.read()
        except LabStateError as error:
            self.trouble = str(error)
            self._loop.hold(Fault.STOP_NOT_KEPT, now_us)
            self._look()
            return
        if self._kept is not None:
            self._newest_number = self._kept.number
            self._loop.stop_latch.go_on_from(self._kept.number)
            if self._kept.holds:
                self._loop.hold(self._kept.fault, now_us)
                self.keep(now_us)

    def keep(self, now_us: int) -> None:
        """Write down what has changed."""
        loop = self._loop
        if self._seen == (loop.stop_latch.number, loop.fault) and (
            not self.trouble or is_current(self._tried_us, now_us, TRY_AGAIN_US)
        ):
            return
        self._look()
        heals = loop.state is State.FAULT and loop.fault == Fault.ENCODERS_SILENT
        holds = loop.stop_latch.number != NO_STOP and not heals
        self._tried_us = now_us
        record = StopRecord(self._newest_number, holds, loop.fault if holds else NO_FAULT)
        if record == self._kept or (self._kept is None and not holds):
            return
        try:
            self._store.write(record)
        except LabStateError as error:
            self.trouble = str(error)
            # A stop that a restart would forget is not said to be one. A release counts all the
            # same: what is written down of it holds the robot, and only longer than it must.
            if holds and (loop.state, loop.fault) != (State.FAULT, Fault.STOP_NOT_KEPT):
                loop.hold(Fault.STOP_NOT_KEPT, now_us)
                self._look()
        else:
            self._kept, self.trouble = record, ""

    def _look(self) -> None:
        self._seen = number, _ = self._loop.stop_latch.number, self._loop.fault
        self._newest_number = max(self._newest_number, number)
