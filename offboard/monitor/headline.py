"""What a person reads first: what a robot is doing in one line, and what is wrong."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import lcmtypes
from koopman_lab.bus.channel import COMMANDER, Channel
from koopman_lab.bus.channels import TIME_PONG, TIME_SYNC
from koopman_lab.bus.motor_loop_faults import why_stopped
from koopman_lab.bus.processes import commanders, died
from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S
from offboard.monitor.process_states import DIED, FINISHED, ProcessState
from offboard.monitor.streams import Stream

MOTOR_LOOP_STATES = ("at rest", "driving", "stopped by the watchdog", "EMERGENCY STOP", "FAULT")
"""By the numbers of ``onboard_status_t``."""
SAMPLER_PHASES = (
    "waiting for robot, cameras and logger",
    "turning towards the next start",
    "driving to the next start",
    "turning to the drawn heading",
    "settling",
    "launching",
    "basis input",
    "braking",
    "complete",
)
"""By the numbers of ``sampler_state_t``."""
REFERENCE_PHASES = ("waiting", "placing the robot", "settling", "driving", "braking", "complete")
"""By the numbers of ``reference_state_t``."""
CONTROLLER_STATES = (
    "waiting",
    "driving",
    "parked",
    "gave up at the time limit",
    "failed",
    "paused",
)
"""By the numbers of ``mpc_state_t``."""
PERIODS = 5
"""So many messages in a row may be late before a stream counts as stale."""
SOONEST_STALE_S = 0.5
FORGOTTEN_S = 30.0
"""So long a commander that fell silent is news; the robot stands, and others may drive it."""


def state_name(names: Sequence[str], number: int) -> str:
    """Return the name for a number of a message, also where the message is nonsense."""
    return names[number] if 0 <= number < len(names) else f"state {number}"


def motor_loop_text(status: lcmtypes.onboard_status_t) -> str:
    """Return what the motor loop does."""
    if status.state == status.FAULT:
        return f"FAULT: {why_stopped(status)}"
    return state_name(MOTOR_LOOP_STATES, status.state)


def stop_text(status: lcmtypes.onboard_status_t) -> str | None:
    """Return what holds the robot in words, also where the message is nonsense."""
    if status.state in (status.ESTOP, status.FAULT):
        return motor_loop_text(status).removeprefix("FAULT: ").lower()
    return None


def calibration_text(state: lcmtypes.sampler_state_t) -> str:
    """Return what a calibration session does."""
    if state.phase == state.DONE:
        return f"calibration complete: {state.segments_done} segments"
    doing = state_name(SAMPLER_PHASES, state.phase)
    if state.phase == state.BASIS:
        doing += f" {state.basis_index}"
    run = min(state.segments_done + 1, state.segments_total)
    return f"calibrating, segment {run} of {state.segments_total}: {doing}"


def reference_text(state: lcmtypes.reference_state_t) -> str:
    """Return what a session of reference runs does."""
    run = min(state.runs_done + 1, state.runs_total)
    return f"reference run {run} of {state.runs_total}: {state_name(REFERENCE_PHASES, state.phase)}"


def parking_text(state: lcmtypes.mpc_state_t) -> str:
    """Return what a parking run does."""
    doing = state_name(CONTROLLER_STATES, state.state)
    if state.state in (state.DRIVING, state.PAUSED):
        distance_m = math.hypot(*state.state_in_goal_frame[:2])
        if math.isfinite(distance_m):
            return f"parking: {doing}, {distance_m:.2f} m from the goal"
    return f"parking: {doing}"


def rightly_silent(entries: Sequence[ProcessState], *, at_rest: bool) -> set[str]:
    """Return the publishers that nobody misses: their work is done, or nobody drives.

    Parameters
    ----------
    entries
        All processes.
    at_rest
        Whether the motor loop says that nobody commands the robot and that it rests.
    """
    silent = {entry.name for entry in entries if entry.state == FINISHED}
    commanding = {entry.name for entry in entries} & commanders()
    if at_rest:
        silent |= commanders()
    return silent | {COMMANDER} if commanding <= silent else silent


def stale_streams(
    streams: Sequence[Stream], config: LabConfig, silent: Collection[str], now_us: int
) -> list[tuple[Stream, float]]:
    """Return each stream that should flow and does not, with its age (s).

    Parameters
    ----------
    streams
        All that were ever heard.
    config
        Says how often each should speak.
    silent
        Publishers that nobody misses.
    now_us
        Time (us).
    """
    rows = []
    for stream in streams:
        rate_hz, channel = stream.nominal_hz(config), stream.channel
        if rate_hz is None or channel is None or _is_exchange(channel):
            continue
        age_s = (now_us - stream.heard_us) / US_PER_S
        passing = channel.publisher in {COMMANDER, *commanders()}
        if channel.publisher in silent or (passing and age_s > FORGOTTEN_S):
            continue
        if age_s > max(PERIODS / rate_hz, SOONEST_STALE_S):
            rows.append((stream, age_s))
    return rows


def _is_exchange(channel: Channel[Any]) -> bool:
    """Return whether it is periodic only as long as somebody drives the robot."""
    return channel.is_command or channel in (TIME_PONG, TIME_SYNC)


def banners(
    entries: Sequence[ProcessState],
    overdue: Sequence[tuple[Stream, float]],
    *,
    lost_view: bool,
) -> list[str]:
    """Return what is wrong, each in one line: who died, which streams are stale.

    Parameters
    ----------
    entries
        All processes.
    overdue
        From :func:`stale_streams`.
    lost_view
        Whether the cameras do not see the robot.
    """
    lines = [
        f"{died(entry.report)}; the table of processes says what it said last"
        for entry in entries
        if entry.state == DIED and entry.report is not None
    ]
    by_publisher: dict[str, list[tuple[Stream, float]]] = {}
    for stream, age_s in overdue:
        who = "" if stream.channel is None else stream.channel.publisher
        by_publisher.setdefault(who, []).append((stream, age_s))
    for publisher, flows in by_publisher.items():
        names = ", ".join(sorted(stream.name for stream, _ in flows))
        longest_s = max(age_s for _, age_s in flows)
        lines.append(f"stale for {longest_s:.0f} s, from the {publisher}: {names}")
    if lost_view:
        lines.append("the cameras do not see the robot")
    return lines
