"""Whether messages come through on the bus, who may speak there, and who does."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.config.change import changed
from koopman_lab.errors import BusError, BusUrlError, ConfigError
from offboard.commands.doctor_checks.finding import Finding

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.config.schema import LabConfig

RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
TRIES = 40
LISTEN_S = 1.0
"""In which every stream of a lab is heard."""


def multicast(lab: LabConfig) -> Iterator[Finding]:
    """Say whether a message that is sent comes back."""
    import lcmtypes
    from koopman_lab.bus.bus_url import route_remedy
    from koopman_lab.bus.channels import ESTOP
    from koopman_lab.bus.realtime import Listener

    # Whether the key can be used is looked at apart.
    probe = changed(changed(lab, "robot", name="DOCTOR"), "bus", key_file=None)
    try:
        speaker, listener = Listener(probe), Listener(probe)
    except BusUrlError as error:
        yield Finding("multicast", "the URL is of no bus", good=False, remedy=str(error))
        return
    except BusError as error:
        yield Finding("multicast", "LCM cannot be opened", good=False, remedy=str(error))
        return
    heard: list[lcmtypes.estop_t] = []
    try:
        listener.subscribe(ESTOP, heard.append)
    except BusError as error:
        yield Finding("multicast", "LCM cannot listen", good=False, remedy=str(error))
        return
    for _ in range(TRIES):
        speaker.publish(ESTOP, lcmtypes.estop_t())
        listener.spin(0.05)
        if heard:
            break
    yield Finding(
        "multicast",
        f"{lab.bus.url}, {'a message came back' if heard else 'nothing sent comes back'}",
        bool(heard),
        remedy=f"{route_remedy(lab.bus.url)}; a firewall may drop UDP as well",
    )


def hostile_datagrams(lab: LabConfig) -> Iterator[Finding]:
    """Say whether the kernel keeps off what the LCM library dies of."""
    from koopman_lab.bus.realtime import Listener

    with contextlib.suppress(BusError):  # a bus that cannot be used is a finding of its own
        # What is wrong with the key is a finding of its own, too.
        fault = Listener(lab, lambda _: None).filter_fault()
        yield Finding(
            "datagram filter",
            fault or "datagrams that are none of LCM's, or too large, reach no process",
            not fault,
            needed=False,
            lacking="NONE",
            remedy="a datagram of 8 bytes from a stranger ends every process that listens; keep "
            "strangers off the bus (ttl=0, a firewall), or use Linux and a udpm:// URL",
        )


def lab_key(lab: LabConfig) -> Iterator[Finding]:
    """Say who may speak on the bus."""
    from koopman_lab.bus.lab_key import OPEN_BUS, configured_key, fingerprint, key_path

    try:
        key = configured_key(lab)
    except ConfigError as error:
        yield Finding("lab's key", str(error), good=False, bad="BROKEN")
        return
    if key is None:
        yield Finding("lab's key", "none", good=False, needed=False, remedy=OPEN_BUS)
        return
    yield Finding("lab's key", f"{fingerprint(key)}, of {key_path(lab)}", good=True)


def receive_buffer(lab: LabConfig) -> Iterator[Finding]:
    """Say whether the kernel grants the buffer that bursts need."""
    requested = lab.bus.receive_buffer_bytes
    granted = int(RMEM_MAX.read_text()) if RMEM_MAX.exists() else None
    detail = "unknown here" if granted is None else f"{granted} bytes granted, {requested} wanted"
    yield Finding(
        "receive buffer",
        detail,
        granted is None or granted >= requested,
        needed=False,
        remedy=f"bursts may be lost; sudo sysctl -w net.core.rmem_max={requested}",
    )


def streams(lab: LabConfig) -> Iterator[Finding]:
    """Say who sends each stream that is heard, by the address of its datagrams."""
    from koopman_lab.bus.bus_url import parse_bus_url
    from offboard.commands.doctor_checks.senders import senders_by_channel
    from offboard.commands.doctor_checks.socket_owners import SocketOwners
    from offboard.terminal.visible_text import one_line

    try:
        heard = senders_by_channel(parse_bus_url(lab.bus.url), LISTEN_S)
    except BusUrlError:  # a finding of its own
        return
    except BusError as error:
        yield Finding("streams", str(error), good=False, needed=False, lacking="unknown")
        return
    if not heard:
        yield Finding("streams", f"none heard in {LISTEN_S:g} s", good=True)
    owners = SocketOwners()
    for name, counts in sorted(heard.items()):
        texts = [
            f"{count / LISTEN_S:g} Hz from {sender}{owners.text(sender)}"
            for sender, count in sorted(counts.items())
        ]
        yield Finding(one_line(f"stream {name}"), one_line("; ".join(texts)), good=True)
