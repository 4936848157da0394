"""A session log made of a recording of another program, which trains like one of our own.

The log holds what a data set needs: the poses, the commands, the configuration, and states of a
sampler that say when which basis input was held (:mod:`~koopman_lab.data.formats.held_inputs`). Its
SESSION_INFO says ``import`` for what was done.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.bus.channels import (
    MOCAP_POSE,
    SAMPLER_STATE,
    SESSION_INFO,
    command_channel,
)
from koopman_lab.bus.message_values import padded
from koopman_lab.config.change import changed
from koopman_lab.config.load import dump_config, parse_config
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.formats.held_inputs import HeldInput, basis_index, held_inputs
from koopman_lab.data.formats.recorded_motion import RecordedMotion, Stream
from koopman_lab.data.segments import LONGEST_STEP
from koopman_lab.errors import DataError
from koopman_lab.eventlog.log_name import LOG_NAME
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.files import replacing_folder
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.installation import DISTRIBUTION
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S

ACTIVITY = "import"
INFO_PERIOD_US = US_PER_S
SHOWN = 5
"""Commands that are named where none is a basis input."""
Row = tuple[int, str, bytes]
"""Time (us), channel, message."""


class ImportedSession(NamedTuple):
    """What was imported: poses, commands, runs by basis index, and the rate of the poses."""

    poses: int
    commands: int
    runs: dict[int, int]
    rate_hz: float


def write_session(motion: RecordedMotion, config: LabConfig, folder: Path) -> ImportedSession:
    """Write a session folder, whole or not at all.

    Parameters
    ----------
    motion
        Poses and commands.
    config
        Names the robot and says its basis inputs; the rate of the cameras is measured, and nothing
        counts as simulated.
    folder
        Must not exist, or be empty.

    Raises
    ------
    DataError
        If there are too few poses, or no basis input was held for long enough.
    ConfigError
        If the poses came at a rate that no configuration may have.
    OSError
        If the folder cannot be written.
    """
    rate_hz = _rate_hz(motion.poses)
    config = config.model_copy(update={"simulation": None})
    text = dump_config(changed(config, "mocap", rate_hz=rate_hz))
    config = parse_config(text, f"the rate of {motion.poses.topic}")
    runs = _runs(motion.commands, config)
    rows = sorted(
        (*_poses(motion.poses, config), *_commands(motion.commands, runs, config)),
        key=lambda row: row[0],
    )
    counts = dict.fromkeys(config.sampler.indexed_inputs, 0)
    for index, _ in runs:
        counts[index] += 1
    with replacing_folder(folder) as temporary, EventLogWriter(temporary / LOG_NAME) as log:
        for utime, name, data in _with_info(rows, config):
            log.write(name, data, utime)
    return ImportedSession(
        len(motion.poses.utime_us), len(motion.commands.utime_us), counts, rate_hz
    )


def _rate_hz(poses: Stream) -> float:
    steps_us = np.diff(poses.utime_us)
    steps_us = steps_us[steps_us > 0]
    if not len(steps_us):
        raise DataError(
            f"{poses.topic}: {len(poses.utime_us)} poses at one time; give a recording in which "
            "the robot drives"
        )
    # Stamps are whole us, and where frames are missing steps are long: the mean of the others.
    usual = steps_us[steps_us <= LONGEST_STEP * np.median(steps_us)]
    return round(US_PER_S / float(np.mean(usual)), 3)


def _runs(commands: Stream, config: LabConfig) -> list[tuple[int, HeldInput]]:
    """Return the runs of basis inputs that are long enough to give a pair, by basis index."""
    processing, inputs = config.processing, config.sampler.indexed_inputs
    least_s = processing.discard_start_s + processing.discard_end_s + 2.0 * processing.dt_s
    held = held_inputs(commands.utime_us, commands.values)
    long_enough = [h for h in held if h.end_us - h.start_us >= least_s * US_PER_S]
    indexed = [(basis_index(commands.values[h.first], inputs), h) for h in long_enough]
    runs = [(index, h) for index, h in indexed if index is not None]
    if not runs:
        raise DataError(
            f"{commands.topic}: no basis input of the configuration was held for {least_s:g} s; "
            f"{_held_longest(commands, held)}. Say which are basis inputs: --set "
            "'sampler.basis_inputs=[[0.2, -0.5], [0.2, 0.5]]' (one for each input of the robot)"
        )
    return runs


def _held_longest(commands: Stream, held: list[HeldInput]) -> str:
    """Return in words which commands were held longest in all."""
    totals: dict[tuple[float, ...], int] = {}
    for h in held:
        u = tuple(float(f"{value:.6g}") for value in commands.values[h.first])
        totals[u] = totals.get(u, 0) + h.end_us - h.start_us
    longest = sorted(totals.items(), key=lambda item: -item[1])[:SHOWN]
    if not longest:
        return "there is no command"
    shown = ", ".join(f"{list(u)} for {us / US_PER_S:.1f} s" for u, us in longest)
    return f"held longest were {shown}"


def _poses(poses: Stream, config: LabConfig) -> Iterator[Row]:
    name = MOCAP_POSE.name(config.robot.name)
    for number, (utime, pose) in enumerate(zip(poses.utime_us, poses.values, strict=True)):
        message = lcmtypes.mocap_pose_t()
        message.utime, message.sequence, message.tracking_valid = int(utime), number, True
        message.x1_m, message.x2_m = float(pose[0]), float(pose[1])
        message.theta_rad = wrap_angle(float(pose[2]))
        yield int(utime), name, message.encode()


def _commands(
    commands: Stream, runs: list[tuple[int, HeldInput]], config: LabConfig
) -> Iterator[Row]:
    """Give the commands, and a state of the sampler with each and at the end of each run."""
    robot = robot_type(config.robot.kind)
    channel, form = command_channel(robot), robot.commanded()
    run_of = {k: n for n, (_, held) in enumerate(runs) for k in range(held.first, held.stop)}
    states = _SamplerStates(config, len(runs))
    for k, (utime, u) in enumerate(zip(commands.utime_us.tolist(), commands.values, strict=True)):
        message: Any = channel.type()
        message.utime, message.sequence, message.commander = utime, k, message.SAMPLER
        message.intent = message.CONTINUE if k else message.BEGIN
        form.encode(message, u.tolist())
        yield utime, channel.name(config.robot.name), message.encode()
        number = run_of.get(k)
        if number is None:
            yield states.row(utime, None)
            continue
        index, held = runs[number]
        yield states.row(utime, (number, index, config.sampler.indexed_inputs[index]))
        ends_alone = k + 1 == held.stop and (
            k + 1 == len(commands.utime_us) or commands.utime_us[k + 1] != held.end_us
        )
        if ends_alone:  # with no command that says so
            states.done = number + 1
            yield states.row(held.end_us, None)
        elif k + 1 == held.stop:
            states.done = number + 1


class _SamplerStates:
    """Counts the states and the runs that are done."""

    def __init__(self, config: LabConfig, runs: int) -> None:
        self.done = 0
        self._name = SAMPLER_STATE.name(config.robot.name)
        self._total, self._sequence = runs, 0

    def row(self, utime: int, run: tuple[int, int, tuple[float, ...]] | None) -> Row:
        """Return a state in a run, by its number, basis index and input, or between runs."""
        state = lcmtypes.sampler_state_t()
        state.utime, state.sequence, state.phase = utime, self._sequence, state.WAIT
        self._sequence += 1
        state.segments_done, state.segments_total = self.done, self._total
        if run is not None:
            state.phase = state.BASIS
            state.segment, state.basis_index, u = run
            state.inputs, state.u = len(u), padded(u, state.MOST_INPUTS)
        return utime, self._name, state.encode()


def _with_info(rows: list[Row], config: LabConfig) -> Iterator[Row]:
    """Give the rows, once a second preceded by what the log needs to explain itself."""
    from importlib.metadata import version

    info = lcmtypes.session_info_t()
    info.activity, info.config_yaml = ACTIVITY, dump_config(config)
    info.version = version(DISTRIBUTION)
    name, due_us = SESSION_INFO.name(config.robot.name), None
    for utime, channel, data in rows:
        if due_us is None or utime >= due_us:
            info.utime, due_us = utime, utime + INFO_PERIOD_US
            yield utime, name, info.encode()
            info.sequence += 1
        yield utime, channel, data
