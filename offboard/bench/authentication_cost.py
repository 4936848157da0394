"""`klab bench authentication`: what the lab's key costs a message, a core, and lockstep."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from offboard.terminal import options
from offboard.terminal.output import out

if TYPE_CHECKING:
    from koopman_lab.bus.channel import Channel
    from koopman_lab.bus.node import Port
    from koopman_lab.config.schema import LabConfig

CAMERA_RATE_HZ = 240.0
"""The fastest stream of a lab (paper, section 5.1)."""
SHOWN = ("MOCAP_POSE", "MOTOR_CMD", "VELOCITY_CMD", "ONBOARD_STATUS")
WAYS = ("encode", "sign", "verify", "take")
"""Encode a message; put the tag behind it; judge the tag; check, decode and hand over a message."""


class Cost(NamedTuple):
    """How long something takes for one message (us)."""

    median: float
    p99: float
    max: float


def authentication(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    messages: Annotated[
        int, typer.Option("--messages", min=100, help="How many of each channel to time.")
    ] = 20_000,
    as_json: options.AsJson = False,
) -> None:
    """Show what signing and verifying cost a message, a core at the cameras' rate, and lockstep.

    Lockstep itself leaves the key out; its share is what it would cost there.

    Example: klab bench authentication
    """
    from koopman_lab.bus import channels

    lab = options.resolve(config, overrides, None)
    by_suffix = {channel.suffix: channel for channel in channels.CHANNELS}
    costs = {suffix: _costs(by_suffix[suffix], messages) for suffix in SHOWN}
    frame = costs["MOCAP_POSE"]
    shares = {way: frame[way].median * 1e-6 * CAMERA_RATE_HZ for way in ("sign", "verify")}
    lockstep = _lockstep_share(lab, frame["sign"].median, frame["verify"].median)
    if as_json:
        rows = {
            name: {way: c._asdict() for way, c in by_way.items()} for name, by_way in costs.items()
        }
        facts = {"cost_us": rows, "share_of_a_core_at_240_hz": shares, "lockstep": lockstep}
        out.print_json(json.dumps(facts))
        return
    out.print(_table(costs))
    out.print(
        f"at {CAMERA_RATE_HZ:g} Hz: signing takes {100 * shares['sign']:.2f} % of a core, "
        f"verifying {100 * shares['verify']:.2f} % for each process that listens"
    )
    out.print(
        f"in lockstep, where the key is left out, it would take {100 * lockstep['share']:.1f} % of "
        f"the time: {lockstep['signed_per_s']:.0f} messages to sign and "
        f"{lockstep['verified_per_s']:.0f} to verify in a virtual second of "
        f"{1e3 * lockstep['wall_s_per_s']:.1f} ms"
    )


def _table(costs: dict[str, dict[str, Cost]]) -> Any:
    from rich.table import Table

    table = Table(title="one message (us)")
    for column in ("channel", "what", "median", "99 %", "max"):
        table.add_column(column, justify="left" if column in ("channel", "what") else "right")
    for suffix, by_way in costs.items():
        for way, cost in by_way.items():
            table.add_row(suffix, way, *(f"{value:.1f}" for value in cost))
    return table


def _costs(channel: Channel[Any], count: int) -> dict[str, Cost]:
    from koopman_lab.bus.authentication import Signer, Verifier
    from koopman_lab.bus.lab_key import KEY_BYTES
    from koopman_lab.bus.subscription import Subscription

    key, name = bytes(KEY_BYTES), channel.name("R1")
    signer, verifier = Signer(key), Verifier(key, name)
    subscription = Subscription(name, channel.type)
    subscription.handlers.append(lambda _: None)
    message = channel.type()
    ns: dict[str, list[int]] = {way: [] for way in WAYS}

    def timed(way: str, do: Callable[[], Any]) -> Any:
        started = time.perf_counter_ns()
        result = do()
        ns[way].append(time.perf_counter_ns() - started)
        return result

    for number in range(count):
        message.utime = message.sequence = number
        data = timed("encode", message.encode)
        signed = timed("sign", partial(signer.sign, name, data))
        timed("verify", partial(verifier.judge, signed))
        timed("take", partial(subscription.receive, signed, number))
    return {way: _cost(times) for way, times in ns.items()}


def _cost(times_ns: list[int]) -> Cost:
    import numpy as np

    times = 1e-3 * np.asarray(times_ns, dtype=np.float64)
    return Cost(*np.percentile(times, [50.0, 99.0, 100.0]).tolist())


class _ProtectedMessages:
    """A node that counts the messages of protected channels."""

    name = "counter"

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def attach(self, port: Port) -> None:
        from koopman_lab.bus.channels import all_channels

        for channel in all_channels():
            if channel.protection != "never":
                port.subscribe_raw(channel, self._count)
        port.every(1.0, lambda _: None)

    def close(self) -> None:
        """Nothing is held."""

    def _count(self, name: str, data: bytes, arrived_us: int) -> None:
        del data, arrived_us
        self.counts[name] += 1


def _lockstep_share(lab: LabConfig, sign_us: float, verify_us: float) -> dict[str, float]:
    """Return what share of lockstep's time the key would take, by what is said there."""
    from offboard.bench.lockstep_speed import slalom_lab

    seconds = 10.0
    lockstep, _ = slalom_lab(lab)
    started = time.perf_counter()
    lockstep.run(seconds)
    wall_s = (time.perf_counter() - started) / seconds
    listeners = {name: len(others) for name, others in lockstep.routes.items()}
    counter = _ProtectedMessages()
    lockstep.add(counter)
    lockstep.run(seconds)
    lockstep.close()
    signed = sum(counter.counts.values()) / seconds
    verified = sum(n * listeners.get(name, 0) for name, n in counter.counts.items()) / seconds
    share = (signed * sign_us + verified * verify_us) * 1e-6 / wall_s
    return {
        "share": share,
        "signed_per_s": signed,
        "verified_per_s": verified,
        "wall_s_per_s": wall_s,
    }
