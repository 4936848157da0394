"""The load of `klab bench view`: a lab that drives, its page, and many who look at it."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import lcmtypes
from koopman_lab.bus.channels import HEARTBEATS
from koopman_lab.errors import LabStateError
from offboard.bench.browser import browser, visit
from offboard.commands.view import HOST, free_port
from offboard.lab.process_cost import cpu_time_s, memory_mb
from offboard.lab.python_process import module_command

if TYPE_CHECKING:
    from offboard.bench.driven_lab import DrivenLab

MEMORY_PERIOD_S = 15.0
SETTLE_S = 5.0
"""Pages load and the server's code grows warm; not measured."""
WATCH = """() => {
  window.delays = [];
  new MutationObserver(() => {
    const lag = parseFloat(document.body.dataset.lagMs), since = performance.now();
    requestAnimationFrame(() => window.delays.push(lag + performance.now() - since));
  }).observe(document.body, { attributes: true, attributeFilter: ["data-lag-ms"] });
}"""
"""The frame after the one that drew is the first at which the picture is surely on its way."""

Seen = tuple[float, float]
"""When a snapshot came (s), and how old it was (ms)."""
Spread = tuple[float, float, float]
"""p50, p99, max (ms)."""


class Load(NamedTuple):
    """What was measured.

    Attributes
    ----------
    cpu_share
        Of one core, taken by the server.
    memory_mb
        Resident memory of the server, every 15 s (MB).
    snapshots_hz
        To the client that got fewest, of those that read.
    snapshot_ms
        From when a snapshot was made until a client had it.
    drawn_ms
        From a camera frame's exposure until the picture frame after the one that drew it; None
        without a browser.
    messages, lost
        In the session log, and missing from it by their numbers.
    ticks, missed_ticks
        Of the motor loop's process.
    """

    cpu_share: float
    memory_mb: list[float]
    snapshots_hz: float
    snapshot_ms: Spread
    drawn_ms: Spread | None
    messages: int
    lost: int
    ticks: int
    missed_ticks: int


def measure(driven: DrivenLab, clients: int) -> Load:
    """Run the lab with its page, and clients that look at it, one of them stopped.

    Parameters
    ----------
    driven
        The lab, and for how long.
    clients
        How many, the stopped one and the browser's page included.

    Raises
    ------
    LabStateError
        If a process dies, the robot is not driven, or no client gets anything.
    """
    from koopman_lab.data.decode import SessionLog
    from offboard.lab.supervisor import start_missing, supervised

    folder, seconds = driven.folder, driven.seconds
    beats: list[lcmtypes.node_status_t] = []
    driven.listener.subscribe(HEARTBEATS["onboard"], beats.append)
    port, meter, delays = free_port(), _Meter(), list[float]()
    address = f"{HOST}:{port}"
    with contextlib.ExitStack() as stack:
        lab = stack.enter_context(supervised(driven.config, folder, driven.listener))
        start_missing(lab, set(), folder)
        lab.start("view", "--port", str(port))
        chromium = stack.enter_context(browser())
        page = None if chromium is None else chromium.new_page()
        if page is not None:
            visit(page, f"http://{address}/")
        readers = clients - 1 - (page is not None)
        reading = stack.enter_context(_clients(address, max(readers, 1)))
        hanging = stack.enter_context(_clients(address, 1))

        def watch(passed_s: float) -> None:
            if passed_s >= SETTLE_S and not meter.begun:
                hanging.send_signal(signal.SIGSTOP)
                meter.begin(lab.process("view"), passed_s)
                if page is not None:
                    page.evaluate(WATCH)
            elif page is not None and meter.begun:
                delays.extend(page.evaluate("() => window.delays.splice(0)"))
            meter.look(passed_s)

        driven.drive(lab, watch)
        cpu_share = meter.end(seconds)
        reading.send_signal(signal.SIGINT)
        snapshots: list[list[Seen]] = json.loads(reading.communicate()[0] or "[]")
    ages = [age_ms for client in snapshots for _, age_ms in client]
    if not snapshots or min(map(len, snapshots)) < 2:
        raise LabStateError(
            f"http://{address}/: a client got nothing; {folder.process_log('view')} may say why"
        )
    flows = SessionLog(folder.log).channels.values()
    return Load(
        cpu_share,
        meter.memory_mb,
        min((len(client) - 1) / (client[-1][0] - client[0][0]) for client in snapshots),
        _spread(ages),
        _spread(delays) if delays else None,
        sum(flow.count for flow in flows),
        sum(flow.lost for flow in flows),
        beats[-1].ticks,
        beats[-1].missed_ticks,
    )


class _Meter:
    """Reads what the kernel counts of a process."""

    def __init__(self) -> None:
        self.memory_mb: list[float] = []
        self.begun = False

    def begin(self, pid: int, now_s: float) -> None:
        self.begun = True
        self._pid = pid
        self._began_s, self._cpu_s, self._due_s = now_s, cpu_time_s(pid), now_s

    def look(self, now_s: float) -> None:
        if self.begun and now_s >= self._due_s:
            self._due_s += MEMORY_PERIOD_S
            self.memory_mb.append(memory_mb(self._pid))

    def end(self, now_s: float) -> float:
        """Return the share of one core since the beginning."""
        self._due_s = now_s
        self.look(now_s)
        return (cpu_time_s(self._pid) - self._cpu_s) / (now_s - self._began_s)


@contextlib.contextmanager
def _clients(address: str, count: int) -> Iterator[subprocess.Popen[str]]:
    """Give a process with so many clients; it tells the age of each snapshot when it is stopped."""
    reader = module_command("offboard.bench.page_clients", address, str(count))
    with subprocess.Popen(
        reader, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def _spread(values: list[float]) -> Spread:
    p50, p99, longest = np.percentile(values, [50, 99, 100]).tolist()
    return round(p50, 2), round(p99, 2), round(longest, 2)
