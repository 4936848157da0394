"""Whether this machine keeps time, has room on its disk, and knows what time it is."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from offboard.commands.doctor_checks.finding import Finding

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

TICKS = 100
LATE_SHARE = 0.5
"""Of a tick's period; who is later than that may miss the deadlines of the motor loop."""
LEAST_FREE_BYTES = 1_000_000_000
"""Hours of a session; see ``logger.largest_file_bytes``."""
TRIAL_BYTES = 65_536
UNSYNCHRONISED = 5
"""TIME_ERROR, what adjtimex(2) returns where nothing keeps the clock."""
TIMEX_BYTES = 256
"""More than ``struct timex`` has on any machine; all zero it asks and changes nothing."""


def timing(lab: LabConfig) -> Iterator[Finding]:
    """Tick as often as the motor loop for a while, and say how late a tick was."""
    period_s = 1.0 / lab.motor_loop.rate_hz
    due_s, late_s = time.monotonic(), []
    for _ in range(TICKS):
        due_s += period_s
        time.sleep(max(due_s - time.monotonic(), 0.0))
        late_s.append(time.monotonic() - due_s)
    worst_s = max(late_s)
    yield Finding(
        "timing",
        f"{TICKS} ticks of {1e3 * period_s:g} ms: median {1e3 * sorted(late_s)[TICKS // 2]:.2f} ms "
        f"late, at most {1e3 * worst_s:.2f} ms",
        worst_s < LATE_SHARE * period_s,
        needed=False,
        lacking="LATE",
        remedy="end what else keeps this machine busy, and let the lab go before it (rtprio in "
        "limits.conf); `klab bench realtime` measures a lab under way",
    )


def disk(lab: LabConfig) -> Iterator[Finding]:
    """Say how much room there is where runs are kept, and whether something can be written."""
    folder = Path("runs") if Path("runs").is_dir() else Path()
    free_bytes = shutil.disk_usage(folder).free
    try:
        began_s = time.monotonic()
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(bytes(TRIAL_BYTES))
            os.fsync(file.fileno())
        took_ms = 1e3 * (time.monotonic() - began_s)
    except OSError as error:
        yield Finding(
            "disk",
            f"{folder.absolute()} cannot be written: {error.strerror}",
            good=False,
            bad="UNUSABLE",
            remedy="make room, or work in another folder; every run takes --out DIR",
        )
        return
    least = max(LEAST_FREE_BYTES, lab.logger.largest_file_bytes)
    yield Finding(
        "disk",
        f"{free_bytes / 1e9:.1f} GB free in {folder.absolute()}, {TRIAL_BYTES // 1024} KiB written "
        f"through in {took_ms:.0f} ms",
        free_bytes >= least,
        needed=False,
        lacking="SHORT",
        remedy=f"long sessions take more than {least / 1e9:.1f} GB; make room",
    )


def clock(lab: LabConfig) -> Iterator[Finding]:
    """Say whether this machine's clock can be right, and whether something keeps it so."""
    del lab
    if time.time() < Path(__file__).stat().st_mtime:
        yield Finding(
            "clock",
            f"it is {time.strftime('%Y-%m-%d %H:%M')} by it, before these files were installed",
            good=False,
            bad="WRONG",
            remedy="set it: sudo timedatectl set-ntp true, or sudo date --set '...'",
        )
        return
    keeps = _is_synchronised()
    said = "the system does not tell who keeps it" if keeps is None else "kept by a time server"
    yield Finding(
        "clock",
        said if keeps is not False else "kept by no time server",
        keeps is not False,
        needed=False,
        lacking="NOT SYNCHRONISED",
        remedy="harmless on one machine; where cameras or desks are on several, let a time server "
        "set all of them: sudo apt install chrony",
    )


def _is_synchronised() -> bool | None:
    """Ask the kernel; None where it does not tell."""
    if sys.platform != "linux":
        return None
    try:
        adjtimex = ctypes.CDLL(None).adjtimex
    except (OSError, AttributeError):
        return None
    state = adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    return None if state < 0 else state != UNSYNCHRONISED
