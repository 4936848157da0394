"""A robot in real time that no session owns, whose processes are started again when they die."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import lcmtypes
from koopman_lab.bus.channels import FAULT, HEARTBEATS, ONBOARD_STATUS, PLANT_TRUTH
from koopman_lab.config.simulation import Fault
from koopman_lab.emulation.faults import fault_message
from koopman_lab.errors import LabStateError
from koopman_lab.units import US_PER_S
from offboard.bench.faults.stage import TruthSample
from offboard.desk.orders import stop_order
from offboard.lab.python_process import module_command

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.lab.run_folder import RunFolder

ROBOT = ("plant", "onboard")
MORE = {"view": ("--port", "0")}
"""Arguments of a node: whoever looks at another lab meanwhile keeps the usual port."""
PATIENCE_S = 60.0
"""For a process to be heard or to end, however busy the machine is."""
WAIT_S = 0.02


class StandingLab:
    """Plant, motor loop and page as processes of their own, and one session after the other.

    Attributes
    ----------
    sights
        The true motion since it was last forgotten, in the order of time.
    faults
        The kinds of faults under way, a bit each, as the plant says.
    status
        The newest of the motor loop, None before the first.
    pids
        The process of each node that was heard, by name.
    session
        The present session, None before the first.

    Parameters
    ----------
    config
        The lab, as written to the run folder.
    folder
        Takes what the processes say.
    listener
        Of this process.
    """

    def __init__(self, config: LabConfig, folder: RunFolder, listener: Listener) -> None:
        self.config, self.listener = config, listener
        self.sights: list[TruthSample] = []
        self.faults = 0
        self.status: lcmtypes.onboard_status_t | None = None
        self.pids: dict[str, int] = {}
        self.session: subprocess.Popen[bytes] | None = None
        self._folder = folder
        self._robot: dict[str, subprocess.Popen[bytes]] = {}
        self._lifeline_read, self._lifeline_write = os.pipe()
        listener.subscribe(PLANT_TRUTH, self._on_truth)
        listener.subscribe(ONBOARD_STATUS, self._on_status)
        for name, channel in HEARTBEATS.items():
            listener.subscribe(channel, partial(self._on_heartbeat, name))

    def revive(self, *names: str) -> None:
        """Start those of the robot's processes that are not there, and wait until they speak.

        Raises
        ------
        LabStateError
            If one does not.
        """
        for name in names:
            process = self._robot.get(name)
            if process is None or process.poll() is not None:
                arguments = ("run", name, "--config", self._folder.config)
                self._robot[name] = self._start(name, *arguments, *MORE.get(name, ()))
        # The page only listens; it is there when it is started.
        self.pids |= {name: self._robot[name].pid for name in names if name not in HEARTBEATS}
        pids = {name: self._robot[name].pid for name in names}
        self.wait(
            lambda: all(self.pids.get(name) == pid for name, pid in pids.items()),
            f"{', '.join(names)}: not heard",
        )

    def begin(self, *command: str | Path) -> None:
        """Start a session of `klab`; its words go to the run folder."""
        self.session = self._start("session", *command)

    def also(self, *command: str | Path) -> subprocess.Popen[bytes]:
        """Start one more command of `klab` beside it."""
        return self._start("also", *command)

    @property
    def ended(self) -> bool:
        """Return whether the session has ended."""
        return self.session is None or self.session.poll() is not None

    def end(self) -> int:
        """End the session as Ctrl-C does; return its exit code.

        Raises
        ------
        LabStateError
            If it does not end.
        """
        assert self.session is not None  # by the order of calls
        if not self.ended:
            self.session.send_signal(signal.SIGINT)
        self.wait(lambda: self.ended, "session: does not end")
        return self.session.returncode

    def inject(self, fault: Fault, duration_s: float) -> None:
        """Let a fault begin, or end with a duration of 0, and wait until the plant says so.

        Raises
        ------
        LabStateError
            If it does not.
        """
        fault = fault.model_copy(update={"duration_s": duration_s})
        bit, lasts = fault_message(fault, 0).kind, duration_s > 0.0

        def confirmed() -> bool:
            self.listener.publish(FAULT, fault_message(fault, self.listener.now_us()))
            return bool(self.faults >> bit & 1) == lasts

        self.wait(confirmed, f"{fault.kind}: the plant does not confirm")

    def release(self) -> None:
        """Release a stop or a fault of the motor loop, if there is one.

        Raises
        ------
        LabStateError
            If it does not obey.
        """
        stopped = (lcmtypes.onboard_status_t.ESTOP, lcmtypes.onboard_status_t.FAULT)
        heard_us = self.listener.now_us()
        self.wait(
            lambda: self.status is not None and self.status.utime >= heard_us,
            "onboard loop: silent",
        )
        if self.status is None or self.status.state not in stopped:
            return
        order = stop_order(lambda: self.status, release=True)
        while (obeyed := order.step(self.listener)) is None:
            self.listener.spin(WAIT_S)
        if not obeyed:
            raise LabStateError("onboard loop: does not confirm the release of its stop")

    def spin(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Listen for a while, or until something is so."""
        end_us = self.listener.now_us() + seconds * US_PER_S
        while self.listener.now_us() < end_us and not until():
            self.listener.spin(WAIT_S)

    def wait(self, condition: Callable[[], bool], otherwise: str) -> None:
        """Listen until something is so.

        Raises
        ------
        LabStateError
            With ``otherwise``, if it is not in time.
        """
        end_us = self.listener.now_us() + PATIENCE_S * US_PER_S
        while not condition():
            if self.listener.now_us() > end_us:
                raise LabStateError(
                    f"{otherwise} within {PATIENCE_S:g} s; {self._folder.path / 'processes'} may "
                    "say why"
                )
            self.listener.spin(WAIT_S)

    def close(self) -> None:
        """End all that is there."""
        processes = [*self._robot.values(), *([self.session] if self.session else [])]
        for process in processes:
            # One that was stopped hears of its end only when it goes on.
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGCONT)
            process.terminate()
        for process in processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(PATIENCE_S)
            process.kill()
            process.wait()
        os.close(self._lifeline_write)
        os.close(self._lifeline_read)

    def _start(self, name: str, *arguments: str | Path) -> subprocess.Popen[bytes]:
        """Start a command of `klab` that ends when this process does, however it ends."""
        file = self._folder.process_log(name)
        file.parent.mkdir(parents=True, exist_ok=True)
        lifeline = self._lifeline_read
        with file.open("ab") as log:
            return subprocess.Popen(
                module_command("offboard.cli.end_with_parent", str(lifeline), *arguments),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=[lifeline],
                start_new_session=True,
            )

    def _on_truth(self, truth: lcmtypes.plant_truth_t) -> None:
        self.sights.append(TruthSample.of(truth))
        self.faults = truth.faults

    def _on_status(self, status: lcmtypes.onboard_status_t) -> None:
        self.status = status

    def _on_heartbeat(self, name: str, beat: lcmtypes.node_status_t) -> None:
        self.pids[name] = beat.pid
