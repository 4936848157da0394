"""One robot as the page shows it, from its messages alone."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.age import is_current
from koopman_lab.bus.channel import OPERATOR, Channel
from koopman_lab.config.load import parse_config
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError
from koopman_lab.units import US_PER_S
from offboard.monitor import headline
from offboard.monitor.collected_segments import CollectedSegments, Point
from offboard.monitor.drives import Drives
from offboard.monitor.history import History
from offboard.monitor.json_values import (
    config_facts,
    flow_row,
    number,
    numbers,
    predicted_points,
    process_row,
    sampler_progress,
)
from offboard.monitor.latest_message import LatestMessage
from offboard.monitor.plot_row import PlotRow, plot_row
from offboard.monitor.process_states import ALIVE, FINISHED, SILENT, ProcessState, ProcessStates
from offboard.monitor.replay_detection import REPLAY_MEMORY_S, ReplayDetection
from offboard.monitor.replay_progress import ReplayProgress
from offboard.monitor.robot_state import drive_times, robot_state
from offboard.monitor.streams import Stream, identity_lines

ROW_S = 0.04
"""At least between two rows of the plots, and two points of the trail; so that each snapshot,
every 50 ms, brings one."""
MOST_ROWS = 2400
"""Two minutes."""
YOUNG_S = 1.0
"""What is older is shown no more as what is."""
TABLES_S = 0.5
"""A person reads no faster."""
LEARNS_US = 500_000
"""So often a configuration is read that is another one: whoever invents them costs little here."""


class _Tables(NamedTuple):
    """What is made only every :data:`TABLES_S`, at ``now_us``."""

    now_us: int
    entries: list[ProcessState]
    stale: list[tuple[Stream, float]]
    channels: list[dict[str, Any]]
    processes: list[dict[str, Any]]
    identity_lines: list[str]


class RobotView:
    """Messages in, snapshot out.

    Parameters
    ----------
    name
        The robot.
    config
        What to assume as long as no session says its configuration.
    known
        Whether it is no assumption, but the configuration of this very robot.
    """

    def __init__(self, name: str, config: LabConfig, *, known: bool = False) -> None:
        self.name = name
        self.config = config
        self._config_facts = config_facts(config)
        self.process_states = ProcessStates()
        self.replay_detection = ReplayDetection()
        self.replay_progress = ReplayProgress()
        self.collected = CollectedSegments()
        self.rows: History[PlotRow] = History(MOST_ROWS)
        self._drives = Drives()
        self._streams: dict[str, Stream] = {}
        self._pose = LatestMessage(channels.MOCAP_POSE)
        self._wheels = LatestMessage(channels.WHEEL_STATE)
        self._status = LatestMessage(channels.ONBOARD_STATUS)
        self._mpc = LatestMessage(channels.MPC_STATE)
        self._sampler = LatestMessage(channels.SAMPLER_STATE)
        self._reference = LatestMessage(channels.REFERENCE_STATE)
        self._interlock = LatestMessage(channels.INTERLOCK)
        self._info = LatestMessage(channels.SESSION_INFO)
        self._latest: dict[str, LatestMessage[Any]] = {
            latest.channel.suffix: latest
            for latest in (
                *(self._pose, self._wheels, self._status, self._mpc, self._reference, self._info),
                self._interlock,
            )
        }
        self._beats = {c.suffix: node for node, c in channels.HEARTBEATS.items()}
        self._config_yaml = ""
        self._config_trouble = ""
        self._learned_us: int | None = None
        self.assumed = not known
        """Whether the configuration is that of the page, and nobody has said it."""
        self._heard_us: int | None = None
        self._spoken_us = 0
        """When somebody spoke last who is more than a command that tells of its processes (us)."""
        self._row_due_us = 0
        self._tables: _Tables | None = None

    def take(self, stream: Stream, channel: Channel[Any], data: bytes, arrived_us: int) -> None:
        """Take a message of this robot, which its stream has taken before."""
        suffix = channel.suffix
        # Beside a robot that speaks nobody may say that what its streams miss was a jump of a log.
        streams = () if self.alive(arrived_us) else self._streams.values()
        if self.replay_progress.take(channel, data, arrived_us, streams):
            return
        self._streams[suffix] = stream
        if channel is not channels.PROCESS and channel.publisher != OPERATOR:
            self._spoken_us = arrived_us
        self._append_row_if_due(arrived_us)
        self.replay_detection.judge(channel, stream.utime, arrived_us)
        latest = self._latest.get(suffix)
        if latest is not None:
            latest.take(data, arrived_us)
            if latest is self._info:
                self._learn_config(arrived_us)
            else:
                self._follow_drive(latest, arrived_us)
        elif channel is channels.SAMPLER_STATE:
            self._sampler.take(data, arrived_us)
            state = self._sampler.read()
            if state is not None:
                self.collected.take(state, self._position(arrived_us))
                self._drives.take_sampler(state, arrived_us)
        elif channel is channels.PROCESS:
            report = LatestMessage(channels.PROCESS)
            report.take(data, arrived_us)
            message = report.read()
            if message is not None:
                self.process_states.take_report(message, arrived_us)
        elif suffix in self._beats:
            self.process_states.take_heartbeat(self._beats[suffix], data, arrived_us)

    def replayed(self, now_us: int) -> bool:
        """Return whether what is heard is a log, sent again: by its times, or as it says itself."""
        says_so = self.replay_progress.snapshot(now_us) is not None
        return self.replay_detection.replayed(now_us) or (says_so and not self.alive(now_us))

    def alive(self, now_us: int) -> bool:
        """Return whether somebody speaks for the robot who is no log."""
        return self.replay_detection.alive(now_us)

    def status(self, now_us: int) -> lcmtypes.onboard_status_t | None:
        """Return what the motor loop said last, None while it is silent."""
        return self._status.young(now_us, YOUNG_S)

    def mpc(self, now_us: int) -> lcmtypes.mpc_state_t | None:
        """Return the controller's last step, None while it is silent."""
        return self._mpc.young(now_us, YOUNG_S)

    def entries(self, now_us: int) -> list[ProcessState]:
        """Return the processes; a commander that said that it is done has finished."""
        mpc, sampler = self._mpc.read(), self._sampler.read()
        done = set()
        if mpc is not None and mpc.state in (mpc.PARKED, mpc.TIME_LIMIT, mpc.FAILED):
            done.add("controller")
        if sampler is not None and sampler.phase == sampler.DONE:
            done.add("sampler")
        reference = self._reference.read()
        if reference is not None and reference.phase == reference.DONE:
            done.add("reference")
        return [
            entry._replace(state=FINISHED)
            if entry.state == SILENT and entry.name in done
            else entry
            for entry in self.process_states.entries(now_us)
        ]

    def identity_lines(self, now_us: int) -> list[str]:
        """Return in words on which channels more speak than one, or numbers do not count."""
        return self._tables_of(now_us).identity_lines

    def snapshot(self, now_us: int) -> dict[str, Any]:
        """Return what the page shows now, the histories left out; see :attr:`rows`."""
        progress = None if self.alive(now_us) else self.replay_progress.snapshot(now_us)
        now_us = self.replay_progress.moment_us(now_us, self._heard_us, self.alive)
        status, mpc, pose = self.status(now_us), self.mpc(now_us), self._pose.young(now_us, YOUNG_S)
        sampler = self._sampler.young(now_us, YOUNG_S)
        wheels = self._wheels.young(now_us, YOUNG_S)
        replayed = self.replayed(now_us)
        over = self.replay_detection.replay_over(now_us)
        lost_view = pose is not None and not pose.tracking_valid
        tables = self._tables_of(now_us)
        waiting = self._waiting(now_us)
        obstacle = f"not driven: {waiting}" if waiting else ""
        trouble = [line for line in (obstacle, self._config_trouble) if line]
        drive = self._drives.newest(now_us)
        state = robot_state(
            now_us,
            gone=now_us - self._spoken_us > REPLAY_MEMORY_S * US_PER_S,
            replay=replayed or over,
            status=status,
            drive=drive,
            waiting=waiting,
        )
        return {
            "state": state._asdict(),
            "drive": drive_times(drive),
            "line": self._headline(now_us, tables.entries, status, mpc, sampler),
            "banners": headline.banners(tables.entries, tables.stale, lost_view=lost_view)
            + tables.identity_lines
            + trouble,
            "replay": replayed or over,
            "replay_progress": progress,
            "steerable": not replayed and self.alive(now_us),
            "pose": None if pose is None else numbers(pose.x1_m, pose.x2_m, pose.theta_rad),
            # Since the camera saw it; a log's only since it was said again.
            "pose_age_s": pose
            and number((now_us - (self._pose.arrived_us if replayed else pose.utime)) / US_PER_S),
            "tracked": pose is not None and bool(pose.tracking_valid),
            "onboard": None if status is None else headline.motor_loop_text(status),
            "stopped": status is not None and status.state in (status.ESTOP, status.FAULT),
            "battery_v": None if status is None else number(status.battery_v),
            "speeds": None if wheels is None else numbers(wheels.v_m_per_s, wheels.omega_rad_per_s),
            "goal": None if mpc is None else numbers(*mpc.goal),
            "driving": mpc is not None and mpc.state == mpc.DRIVING,
            "horizon": [] if mpc is None else predicted_points(mpc),
            "sampler": None if sampler is None else sampler_progress(sampler),
            **self._config_facts,
            "assumed": self.assumed,
            "channels": tables.channels,
            "processes": tables.processes,
        }

    def _waiting(self, now_us: int) -> str:
        """Return why whoever commands does not drive, in words; empty if nothing forbids it."""
        interlock = self._interlock.young(now_us, YOUNG_S)
        return "" if interlock is None else interlock.reason

    def _follow_drive(self, latest: LatestMessage[Any], now_us: int) -> None:
        """Look at a message of whoever drives."""
        if latest is self._mpc and (step := self._mpc.read()) is not None:
            self._drives.take_mpc(step, now_us, self._waiting(now_us))
        elif latest is self._reference and (state := self._reference.read()) is not None:
            self._drives.take_reference(state, now_us)

    def _learn_config(self, now_us: int) -> None:
        if self._learned_us is not None and is_current(self._learned_us, now_us, LEARNS_US):
            return
        info = self._info.read()
        if info is None or info.config_yaml == self._config_yaml:
            return
        self._learned_us = now_us
        self._config_yaml, self._config_trouble = info.config_yaml, ""
        try:
            self.config = parse_config(info.config_yaml, channels.SESSION_INFO.name(self.name))
            self._config_facts = config_facts(self.config)
            self.assumed = False
        except LabError:
            self._config_trouble = (
                "the session's configuration is none of this version; sets and limits shown are "
                "those of the viewer"
            )

    def _position(self, now_us: int) -> Point | None:
        pose = self._pose.young(now_us, YOUNG_S)
        if pose is None or not pose.tracking_valid:
            return None
        x1, x2 = round(pose.x1_m, 4), round(pose.x2_m, 4)
        return (x1, x2) if math.isfinite(x1) and math.isfinite(x2) else None

    def _append_row_if_due(self, arrived_us: int) -> None:
        """Make a row of what was known before a message that arrives, where one is due."""
        heard_us, self._heard_us = self._heard_us, arrived_us
        if (
            heard_us is not None
            and not self._row_due_us - US_PER_S <= arrived_us < self._row_due_us
        ):
            self._row_due_us = arrived_us + round(ROW_S * US_PER_S)
            self.rows.append(self._plot_row(heard_us))

    def _plot_row(self, now_us: int) -> PlotRow:
        pose, wheels = self._pose.young(now_us, YOUNG_S), self._wheels.young(now_us, YOUNG_S)
        return plot_row(now_us, pose, wheels, self.status(now_us), self.mpc(now_us))

    def _headline(
        self,
        now_us: int,
        entries: list[ProcessState],
        status: lcmtypes.onboard_status_t | None,
        mpc: lcmtypes.mpc_state_t | None,
        sampler: lcmtypes.sampler_state_t | None,
    ) -> str:
        if self._heard_us is None and self.replay_progress.snapshot(now_us) is not None:
            return "replay: nothing was sent yet"
        silent_us = now_us - (self._heard_us or 0)
        if self.replay_detection.replay_over(now_us):
            return f"replay: over for {silent_us / US_PER_S:.0f} s"
        if silent_us > REPLAY_MEMORY_S * US_PER_S:
            return f"nothing heard for {silent_us / US_PER_S:.0f} s"
        prefix = "replay: " if self.replayed(now_us) else ""
        if status is not None and (stop := headline.stop_text(status)) is not None:
            return f"{prefix}stopped: {stop}; it stands until it is released"
        if mpc is not None:
            return prefix + headline.parking_text(mpc)
        if sampler is not None:
            return prefix + headline.calibration_text(sampler)
        reference = self._reference.young(now_us, YOUNG_S)
        if reference is not None:
            return prefix + headline.reference_text(reference)
        if status is not None:
            nobody = "" if status.commander else ", nobody commands it"
            return f"{prefix}{headline.motor_loop_text(status)}{nobody}{self._assumption()}"
        speaking = ", ".join(entry.name for entry in entries if entry.state == ALIVE)
        heard = speaking or "no process"
        return f"{prefix}the motor loop is silent; heard: {heard}{self._assumption()}"

    def _assumption(self) -> str:
        """Return what to add while nobody drives: a session says its configuration, a lab none."""
        return "; size and sets as this viewer assumes" if self.assumed else ""

    def _stale_streams(
        self, now_us: int, entries: list[ProcessState]
    ) -> list[tuple[Stream, float]]:
        if self.replay_detection.replay_over(now_us):
            return []
        status = self.status(now_us)
        at_rest = status is not None and status.state == status.REST and not status.commander
        over = headline.rightly_silent(entries, at_rest=at_rest)
        return headline.stale_streams(list(self._streams.values()), self.config, over, now_us)

    def _tables_of(self, now_us: int) -> _Tables:
        tables = self._tables
        if tables is None or not 0 <= now_us - tables.now_us < TABLES_S * US_PER_S:
            entries = self.entries(now_us)
            stale = self._stale_streams(now_us, entries)
            names = {stream.name for stream, _ in stale}
            streams = sorted(self._streams.values(), key=lambda stream: stream.name)
            flows = [stream.flow(now_us, self.config) for stream in streams]
            tables = self._tables = _Tables(
                now_us,
                entries,
                stale,
                [flow_row(flow) | {"stale": flow.name in names} for flow in flows],
                [process_row(entry) for entry in entries],
                identity_lines(flows),
            )
        return tables
