"""Starts nodes as processes, watches them, and leaves none behind."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from types import FrameType

import lcmtypes
from koopman_lab.bus.channels import HEARTBEATS, PROCESS
from koopman_lab.bus.processes import Stop, process
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.files import writing_where_named
from koopman_lab.units import US_PER_S
from offboard.lab.child_process import KILLED, end_child, exit_text, silence_text
from offboard.lab.process_notes import ProcessNote, last_lines
from offboard.lab.python_process import module_command
from offboard.lab.run_folder import RunFolder
from offboard.monitor.process_states import SILENT_S
from offboard.terminal.output import err

READY_LIMIT_S = 30.0
"""Importing the solver on a busy board takes seconds."""
LONGEST_LINE = 200
"""Characters of each of the last lines that go over the bus."""
FAREWELLS = 3
"""How a process ended is said this often: UDP loses messages, and nobody says it later."""
ONLOOKER_S = 1.0
"""So long who only looks on, as the page, goes on after a process died, to say so."""


class Supervisor:
    """Child processes of one command.

    Each child holds the read end of a pipe and ends when the write end here is gone, so killing
    the supervisor with SIGKILL leaves nobody behind. Children have sessions of their own: Ctrl-C
    in the terminal reaches only the supervisor, which stops them in order.

    Parameters
    ----------
    config
        The lab, as written to the run folder.
    folder
        Takes the processes' own logs.
    listener
        Of this process.
    """

    def __init__(self, config: LabConfig, folder: RunFolder, listener: Listener) -> None:
        self.config = config
        self._folder = folder
        self._listener = listener
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._started_us: dict[str, int] = {}
        self._heard_us: dict[str, int] = {}
        self._ended: dict[str, tuple[int, str]] = {}
        self._announced_us = 0
        self._note = ProcessNote(config, folder)
        self._lifeline_read, self._lifeline_write = os.pipe()
        for name, channel in HEARTBEATS.items():
            listener.subscribe(channel, partial(self._on_heartbeat, name))

    def start(self, name: str, *arguments: str | Path, pass_fds: Sequence[int] = ()) -> None:
        """Start a node; its standard output and error go to its file in the run folder.

        It inherits the file descriptors ``pass_fds``.

        Raises
        ------
        NotWrittenError
            If that file cannot be written.
        """
        command_line = module_command(
            *("offboard.cli.main", "run", name, "--config", self._folder.config),
            *("--lifeline-fd", str(self._lifeline_read), *arguments),
        )
        file = self._folder.process_log(name)
        with writing_where_named(file, "see whether the disk is full or read-only"):
            file.parent.mkdir(exist_ok=True)
            log = file.open("ab")
        with log:
            self._children[name] = subprocess.Popen(
                command_line,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=[self._lifeline_read, *pass_fds],
                start_new_session=True,
            )
        self._started_us[name] = self._listener.now_us()
        self._heard_us.pop(name, None)
        self._note.started(name, self._children[name].pid)

    def wait_ready(self, *names: str) -> None:
        """Wait until these children have been heard on the bus.

        Raises
        ------
        LabStateError
            If one ends, or is not heard in time.
        """
        end_s = time.monotonic() + READY_LIMIT_S
        while any(n not in self._heard_us for n in names):
            self.check()
            if time.monotonic() > end_s:
                silent = [n for n in names if n not in self._heard_us]
                raise LabStateError(
                    f"{', '.join(silent)}: started, but not heard on {self.config.bus.url} within "
                    f"{READY_LIMIT_S:g} s; `klab doctor` looks at the bus"
                )
            self._listener.spin(0.1)

    def check(self) -> None:
        """Refuse to go on without a process that should be running.

        Raises
        ------
        LabStateError
            If a child has ended by itself with an error, or a node that others need has ended.
        """
        for name, child in self._children.items():
            code = child.poll()
            if code is None or (code == 0 and process(name).commands):
                continue
            file, how = self._folder.process_log(name), exit_text(code)
            lines = last_lines(file)
            self._note_end(name, lcmtypes.process_t.DIED, how)
            self._announce(FAREWELLS)
            self._note.died(name, how, self._announced_us)
            last = "\n".join(f"    {line}" for line in lines) or f"    ({silence_text(file)})"
            raise LabStateError(f"{name} died ({how}); {file} ends with:\n{last}")
        if self._listener.now_us() >= self._announced_us + self._period_us():
            self._announce()

    def process(self, name: str) -> int:
        """Return the process number of a child."""
        return self._children[name].pid

    def ended(self, name: str) -> bool:
        """Return whether a child has ended."""
        return self._children[name].poll() is not None

    def stop(self) -> None:
        """Stop all children in order: SIGINT, then SIGTERM, then SIGKILL, 3 s each; say so."""
        for name in self._in_order():
            if process(name).stops is Stop.ONLOOKER and any(
                state == lcmtypes.process_t.DIED for state, _ in self._ended.values()
            ):
                time.sleep(ONLOOKER_S)
            self._end(name)
        self._announce(FAREWELLS)
        self._note.close()
        os.close(self._lifeline_write)
        os.close(self._lifeline_read)

    def stop_lab(self) -> None:
        """Stop the children as :meth:`stop` does, but for those that only look on.

        From then on the others are spoken of no more: somebody may start them anew.
        """
        stopped = [name for name in self._in_order() if process(name).stops is not Stop.ONLOOKER]
        for name in stopped:
            self._end(name)
        self._announce(FAREWELLS)
        for name in stopped:
            del self._children[name]
            del self._ended[name]

    def _in_order(self) -> list[str]:
        return sorted(self._children, key=lambda name: process(name).stops)

    def _end(self, name: str) -> None:
        """Stop one child; say so."""
        killed = end_child(self._children[name])
        code = self._children[name].returncode
        how = KILLED if killed else "" if code is None else exit_text(code)
        self._note_end(name, lcmtypes.process_t.FINISHED, how)
        if killed:
            with contextlib.suppress(OSError):  # of a terminal that was closed
                err.print(f"{name} did not end by itself: {KILLED}")
        self._announce()

    def _on_heartbeat(self, name: str, beat: lcmtypes.node_status_t) -> None:
        """Take a heartbeat; the logger of another command is none of ours."""
        if name in self._children and beat.pid == self._children[name].pid:
            self._heard_us[name] = self._listener.now_us()

    def _state_unless_ended(self, name: str) -> int:
        """Return how a child is that has not ended: running, starting or silent."""
        process_t = lcmtypes.process_t
        if name not in HEARTBEATS:
            return process_t.RUNNING
        heard_us = self._heard_us.get(name)
        if heard_us is None:
            age_s = (self._announced_us - self._started_us[name]) / US_PER_S
            return process_t.STARTING if age_s <= READY_LIMIT_S else process_t.SILENT
        age_s = (self._announced_us - heard_us) / US_PER_S
        return process_t.RUNNING if age_s <= SILENT_S else process_t.SILENT

    def _note_end(self, name: str, state: int, how: str) -> None:
        """Keep how a child ended; the first word counts."""
        self._ended.setdefault(name, (state, how))

    def _period_us(self) -> int:
        return round(US_PER_S / self.config.bus.heartbeat_rate_hz)

    def _announce(self, times: int = 1) -> None:
        """Say on the bus what is known of each child."""
        self._announced_us = self._listener.now_us()
        for name, child in list(self._children.items()) * times:
            message = lcmtypes.process_t()
            message.utime = self._announced_us
            message.name, message.pid, message.host = name, child.pid, socket.gethostname()
            message.supervisor_pid = os.getpid()
            message.log_file = str(self._folder.process_log(name).absolute())
            if child.poll() == 0 and process(name).commands:
                self._note_end(name, message.FINISHED, exit_text(0))
            message.state, message.ended = self._ended.get(name) or (
                self._state_unless_ended(name),
                "",
            )
            if message.state == message.DIED:
                lines = last_lines(self._folder.process_log(name))
                message.last_lines = "\n".join(line[:LONGEST_LINE] for line in lines)
            self._listener.publish(PROCESS, message)


@contextlib.contextmanager
def supervised(config: LabConfig, folder: RunFolder, listener: Listener) -> Iterator[Supervisor]:
    """Give a supervisor to the block and stop its children afterwards, however the block ends.

    Inside, SIGTERM and the end of the terminal act like Ctrl-C, and SIGINT does so even where a
    shell that started the command in the background had it ignored.
    """
    supervisor = Supervisor(config, folder, listener)
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as `nohup` leaves it
        numbers.append(signal.SIGHUP)
    before = {n: signal.signal(n, _interrupt) for n in numbers}
    try:
        yield supervisor
    finally:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        supervisor.stop()
        for number, handler in before.items():
            signal.signal(number, handler)


def start_missing(
    supervisor: Supervisor, present: set[str], folder: RunFolder, *, resume: bool = False
) -> None:
    """Start the logger, and plant and onboard loop unless they are present; wait until ready.

    With ``resume`` the logger goes on behind the log of the run folder.

    Raises
    ------
    ConfigError
        If a plant would be needed, and nothing is simulated.
    LabStateError
        If one does not start.
    """
    names = ["logger"] if "onboard" in present else ["logger", "plant", "onboard"]
    if "plant" in names:
        supervisor.config.require_simulation()
    supervisor.start("logger", "--folder", folder.path, *(["--resume"] if resume else []))
    for name in names[1:]:
        supervisor.start(name)
    supervisor.wait_ready(*names)


def _interrupt(number: int, frame: FrameType | None) -> None:
    del number, frame
    raise KeyboardInterrupt
