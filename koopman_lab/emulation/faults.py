"""Faults on demand: what goes wrong, from when until when."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple, get_args

from pydantic import ValidationError

import lcmtypes
from koopman_lab.config.simulation import FAULT_DETAILS, Fault, FaultKind, PlannedFault
from koopman_lab.units import US_PER_S

KINDS: tuple[FaultKind, ...] = get_args(FaultKind)
"""Kinds of faults, in the order of their numbers in ``fault_t``."""
WHEELS = ("both", "left", "right")
"""Choices of wheels, in the order of their numbers in ``fault_t``."""


class Effects(NamedTuple):
    """What is wrong at one time.

    Attributes
    ----------
    occluded
        The cameras see no marker.
    encoder_stuck, motor_stalled
        Whether the counter stands still, and whether the rotor is locked: (left, right).
    battery_v
        Terminal voltage in place of the battery's own (V), None if that is as it is.
    loss
        Share of the messages that the radio loses, each way, besides those of its own.
    clock_jump_us
        How far the board's clock is ahead of where it should be (us).
    kinds
        Bit k is set for the kind k of ``fault_t``.
    """

    occluded: bool = False
    encoder_stuck: tuple[bool, bool] = (False, False)
    motor_stalled: tuple[bool, bool] = (False, False)
    battery_v: float | None = None
    loss: float = 0.0
    clock_jump_us: int = 0
    kinds: int = 0


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
    details = {name: values[name] for name in FAULT_DETAILS[kind]}
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
    effects = effects._replace(kinds=effects.kinds | 1 << KINDS.index(fault.kind))
    left, right = fault.wheel in ("left", "both"), fault.wheel in ("right", "both")
    if fault.kind == "occlusion":
        return effects._replace(occluded=True)
    if fault.kind == "encoder_stuck":
        was_left, was_right = effects.encoder_stuck
        return effects._replace(encoder_stuck=(was_left or left, was_right or right))
    if fault.kind == "motor_stalled":
        was_left, was_right = effects.motor_stalled
        return effects._replace(motor_stalled=(was_left or left, was_right or right))
    if fault.kind == "battery_low":
        return effects._replace(battery_v=fault.battery_v)
    if fault.kind == "clock_jump":
        jump_us = round((fault.jump_s or 0.0) * US_PER_S)
        return effects._replace(clock_jump_us=effects.clock_jump_us + jump_us)
    loss = 1.0 if fault.kind == "radio_cut" else fault.loss or 0.0
    return effects._replace(loss=max(effects.loss, loss))
