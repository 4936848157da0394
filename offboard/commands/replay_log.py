"""`klab replay`: send a log again, for everybody who listens."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import ConfigError, LabStateError
from offboard.terminal import options
from offboard.terminal.output import err, progress

if TYPE_CHECKING:
    from koopman_lab.eventlog.eventlog import Event

REPLAY_URL = "udpm://239.255.76.68:7668?ttl=0"
"""Not the bus of any lab by default."""


def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log, or its run folder.")],
    speed: Annotated[
        float, typer.Option("--speed", metavar="S", help="Times as fast as it was recorded.")
    ] = 1.0,
    url: Annotated[
        str, typer.Option("--url", help="LCM bus; not that of a live robot.")
    ] = REPLAY_URL,
) -> None:
    """Send every message of a log in its own rhythm; who listens on the bus sees it as live.

    Damaged places are passed over with a warning. Refused where a robot of the log is alive.

    Example: klab replay runs/calibration --speed 4
    """
    from koopman_lab.bus.channels import robots_of
    from koopman_lab.bus.multicast import open_lcm
    from koopman_lab.replay.timed_replay import replay as send
    from koopman_lab.replay.timed_replay import rhythm
    from koopman_lab.units import US_PER_S
    from offboard.lab.session_runner import INTERRUPTED

    if not 0.0 < speed < float("inf"):
        raise ConfigError(f"--speed {speed:g}: must be above 0, for example 4")
    events = _events(log)
    _refuse_live(robots_of({event.channel for event in events}), url)
    due_us, jumps = rhythm([event.timestamp_us for event in events])
    if jumps:
        err.print(
            f"{jumps} times the log's clock was set, or its times are damaged: no pause there"
        )
    bus = open_lcm(options.resolve(None, None, None, url=url))
    total_s, reached_s = round(due_us[-1] / US_PER_S, 1), 0.0
    with progress("replaying", "s") as report:

        def show(now_s: float) -> None:
            nonlocal reached_s
            reached_s = round(now_s, 1)
            report(reached_s, total_s)

        try:
            done = send(events, due_us, bus, speed, show)
        except KeyboardInterrupt:
            err.print(f"interrupted after {reached_s:.1f} of {total_s:.1f} s of the log")
            raise typer.Exit(INTERRUPTED) from None
    err.print(
        f"{done.events} events of {total_s:.1f} s sent in {done.took_s:.1f} s on {url}, the latest "
        f"{done.latest_s * 1e3:.1f} ms behind its time"
    )


def _events(log: Path) -> list[Event]:
    from koopman_lab.eventlog.eventlog import Damage
    from koopman_lab.replay.rotated_log import read_rotated_log

    damage: list[Damage] = []
    events = read_rotated_log(log, salvage=True, damage=damage)
    for stretch in damage:
        err.print(f"{log}: damaged, passed over: {stretch}")
    return events


def _refuse_live(robots: list[str], url: str) -> None:
    """Refuse a bus on which somebody would act on the log.

    The onboard loop takes no stale command, but motors take what is said on their wire.
    """
    from koopman_lab.bus.processes import Stop, stopping
    from offboard.lab.present_nodes import present_nodes

    acting = stopping(Stop.COMMANDER, Stop.BOARD, Stop.HARDWARE)
    for robot in robots:
        listener = options.listen(options.resolve(None, None, None, url=url, robot_name=robot))
        alive = sorted(present_nodes(listener) & acting)
        if alive:
            raise LabStateError(
                f"{robot} is alive on {url} ({', '.join(alive)}): the log's motor commands, "
                "encoder counts and poses would mix with its own; stop it, or replay on another "
                f"bus, for example --url {REPLAY_URL!r}, and listen there"
            )
