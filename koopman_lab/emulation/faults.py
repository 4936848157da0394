"""Faults on demand: what goes wrong, from when until when."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from pydantic import ValidationError

import lcmtypes
from koopman_lab.config.fault_kinds import FAULT_KINDS, FaultKind
from koopman_lab.config.simulation import Fault, PlannedFault
from koopman_lab.units import US_PER_S

KINDS: tuple[FaultKind, ...] = tuple(FAULT_KINDS)
"""Kinds of faults, in the order of their numbers in ``fault_t``."""
WHEELS = ("both", "left", "right")
"""Choices of wheels, in the order of their numbers in ``fault_t``."""


_BITS = {kind: 1 << number for number, kind in enumerate(KINDS)}
_NEITHER = (False, False)


class Effects(NamedTuple):
    """What is wrong at one time.

    What has no more to it than being under way is told by :meth:`includes`.

    Attributes
    ----------
    encoder_stuck, encoder_reversed
        Whether the counter stands still, and whether it counts backwards: (left, right).
    motor_stalled, motor_reversed
        Whether the rotor is locked, and whether it turns backwards: (left, right).
    battery_v
        Terminal voltage in place of the battery's own (V), None if that is as it is.
    loss
        Share of the messages that the radio loses, each way, besides those of its own.
    clock_jump_us
        How far the board's clock is ahead of where it should be (us).
    camera_clock_us
        How far the stamps of the cameras are ahead of where they should be (us).
    kinds
        Bit k is set for the kind k of ``fault_t``.
    """

    encoder_stuck: tuple[bool, bool] = _NEITHER
    encoder_reversed: tuple[bool, bool] = _NEITHER
    motor_stalled: tuple[bool, bool] = _NEITHER
    motor_reversed: tuple[bool, bool] = _NEITHER
    battery_v: float | None = None
    loss: float = 0.0
    clock_jump_us: int = 0
    camera_clock_us: int = 0
    kinds: int = 0

    def includes(self, kind: FaultKind) -> bool:
        """Return whether a fault of this kind is under way."""
        return bool(self.kinds & _BITS[kind])


NO_EFFECTS = Effects()


class _Span(NamedTuple):
    start_us: float
    end_us: float
    fault: Fault


class Faults:
    """The faults under way and to come; asking costs one comparison while nothing changes.

    Parameters
    ----------
    planned
        What comes by itself.
    start_us
        Time (us) from which ``at_s`` counts.
    """

    def __init__(self, planned: Iterable[PlannedFault], start_us: int) -> None:
        self._spans = [_span(fault, start_us + fault.at_s * US_PER_S) for fault in planned]
        self.effects = NO_EFFECTS
        """What is wrong, as last asked."""
        self.change_us: float = -math.inf
        """Before this time (us) nothing changes."""

    def inject(self, fault: Fault, now_us: int) -> None:
        """Begin a fault; one of the same kind and wheel that is under way ends."""
        self._spans = [
            span
            for span in self._spans
            if span.start_us > now_us
            or (span.fault.kind, span.fault.wheel) != (fault.kind, fault.wheel)
        ]
        self._spans.append(_span(fault, now_us))
        self.change_us = -math.inf

    def obey(self, message: lcmtypes.fault_t, now_us: int) -> None:
        """Begin the fault that a message asks for; none if the message is not allowed."""
        fault = fault_of(message)
        if fault is not None:
            self.inject(fault, now_us)

    def at(self, now_us: int) -> Effects:
        """Return what is wrong at ``now_us``; calls come in order of time.

        The same object is returned until something changes.
        """
        if now_us >= self.change_us:
            self._spans = [span for span in self._spans if span.end_us > now_us]
            under_way = [span.fault for span in self._spans if span.start_us <= now_us]
            self.effects = _combined(under_way) if under_way else NO_EFFECTS
            changes = (t for span in self._spans for t in (span.start_us, span.end_us))
            self.change_us = min((t for t in changes if t > now_us), default=math.inf)
        return self.effects


def fault_message(fault: Fault, utime: int) -> lcmtypes.fault_t:
    """Return the message that begins a fault."""
    message = lcmtypes.fault_t()
    message.utime = utime
    message.kind = KINDS.index(fault.kind)
    message.wheel = WHEELS.index(fault.wheel or "both")
    message.duration_s = math.inf if fault.duration_s is None else fault.duration_s
    message.battery_v = fault.battery_v or 0.0
    message.loss = fault.loss or 0.0
    message.jump_s = fault.jump_s or 0.0
    return message


def fault_of(message: lcmtypes.fault_t) -> Fault | None:
    """Return the fault that a message begins, None if the message is not allowed."""
    if not (0 <= message.kind < len(KINDS) and 0 <= message.wheel < len(WHEELS)):
        return None
    kind = KINDS[message.kind]
    values = {
        "wheel": WHEELS[message.wheel],
        "battery_v": message.battery_v,
        "loss": message.loss,
        "jump_s": message.jump_s,
    }
    details = {name: values[name] for name in FAULT_KINDS[kind].details}
    try:
        return Fault.model_validate({"kind": kind, "duration_s": message.duration_s} | details)
    except ValidationError:
        return None


def _span(fault: Fault, start_us: float) -> _Span:
    lasts_s = math.inf if fault.duration_s is None else fault.duration_s
    return _Span(start_us, start_us + lasts_s * US_PER_S, fault)


def _combined(faults: Iterable[Fault]) -> Effects:
    effects = NO_EFFECTS
    for fault in faults:
        effects = _with_fault(effects, fault)
    return effects


def _with_fault(effects: Effects, fault: Fault) -> Effects:
    effects = effects._replace(kinds=effects.kinds | _BITS[fault.kind])
    jump_us = round((fault.jump_s or 0.0) * US_PER_S)
    if fault.wheel is not None:
        # The field has the name of the kind.
        left, right = getattr(effects, fault.kind)
        both = left or fault.wheel != "right", right or fault.wheel != "left"
        field: dict[str, Any] = {fault.kind: both}
        return effects._replace(**field)
    if fault.kind == "battery_low":
        return effects._replace(battery_v=fault.battery_v)
    if fault.kind == "clock_jump":
        return effects._replace(clock_jump_us=effects.clock_jump_us + jump_us)
    if fault.kind == "camera_clock":
        return effects._replace(camera_clock_us=effects.camera_clock_us + jump_us)
    loss = 1.0 if fault.kind == "radio_cut" else fault.loss or 0.0
    return effects._replace(loss=max(effects.loss, loss))
