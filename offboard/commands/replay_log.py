"""`klab replay`: send a log again, for everybody who listens."""

from __future__ import annotations

import contextlib
import math
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopman_lab.errors import BusError, ConfigError, LabStateError, LogError
from offboard.terminal import options
from offboard.terminal.exit_codes import ExitCode
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
    start_s: Annotated[
        float, typer.Option("--start", metavar="S", help="Begin so late in the log, s.")
    ] = 0.0,
    end_s: Annotated[
        float | None,
        typer.Option("--end", metavar="S", help="End so late in the log, s; default: its end."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="NAME", help="Only this channel, or those of a pattern: '*_POSE'."
        ),
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    paused: Annotated[
        bool, typer.Option("--paused", help="Wait at the beginning for somebody to start it.")
    ] = False,
    url: Annotated[
        str, typer.Option("--url", help="LCM bus; not that of a live robot.")
    ] = REPLAY_URL,
) -> None:
    """Send every message of a log in its own rhythm; who listens on the bus sees it as live.

    At a terminal the space bar pauses and goes on, left and right go 5 s back and on, up and down
    change the speed. The page of `klab view --url URL` has a bar for the same.

    Damaged places are passed over with a warning. Refused where a robot of the log is alive.

    Example: klab replay runs/calibration --speed 4 --start 10
    """
    from koopman_lab.bus.channels import robots_of
    from koopman_lab.bus.multicast import open_lcm
    from koopman_lab.replay.bus_steering import BusSteering, attach_to_bus
    from koopman_lab.replay.playback import Playback
    from koopman_lab.replay.timed_replay import Replay, clock_us, rhythm
    from koopman_lab.units import US_PER_S
    from offboard.commands.replay_steering import Steering
    from offboard.terminal.keyboard import Keyboard, has_keyboard

    if not 0.0 < speed < math.inf:
        raise ConfigError(f"--speed {speed:g}: must be above 0, for example 4")
    events = _events(log)
    robots = robots_of({event.channel for event in events})
    _refuse_live(robots, url)
    due_us, jumps = rhythm([event.timestamp_us for event in events])
    if jumps:
        err.print(
            f"{jumps} times the log's clock was set, or its times are damaged: no pause there"
        )
    start_us, end_us = _stretch_us(log, start_s, end_s, due_us[-1])
    events, due_us = _chosen(log, events, due_us, only)
    lab = options.resolve(None, None, None, url=url)
    bus = open_lcm(lab)
    playback = Playback(
        due_us,
        clock_us(),
        speed=speed,
        start_us=start_us,
        end_us=end_us,
        loop=loop,
        paused=paused,
    )
    sending = Replay(events, playback, bus)
    on_bus = BusSteering(playback, clock_us, sending.show_present)
    heard = True
    try:
        attach_to_bus(on_bus, lab, bus, robots)
    except BusError as error:
        heard = False
        err.print(f"{error}\nthe replay is sent all the same; no page can steer it")
    total_s, reached_s = round(end_us / US_PER_S, 1), 0.0
    with contextlib.ExitStack() as stack:
        keyboard = stack.enter_context(Keyboard()) if has_keyboard() else None
        report = stack.enter_context(progress("replaying", "s"))
        steering = Steering(playback, on_bus, bus if heard else None, keyboard)

        def show(now_s: float) -> None:
            nonlocal reached_s
            reached_s = round(now_s, 1)
            report(reached_s, total_s, steering.note())

        # Also where a shell that started it in the background had it ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            done = sending.run(show, steering.wait)
        except KeyboardInterrupt:
            err.print(f"interrupted after {reached_s:.1f} of {total_s:.1f} s of the log")
            raise typer.Exit(ExitCode.INTERRUPTED) from None
    err.print(
        f"{done.events} events of {(end_us - start_us) / US_PER_S:.1f} s sent in {done.took_s:.1f} "
        f"s on {url}, the latest {done.latest_s * 1e3:.1f} ms behind its time"
    )


def _events(log: Path) -> list[Event]:
    from koopman_lab.eventlog.eventlog import Damage
    from koopman_lab.replay.rotated_log import read_rotated_log

    damage: list[Damage] = []
    events = read_rotated_log(log, salvage=True, damage=damage)
    for stretch in damage:
        err.print(f"{log}: damaged, passed over: {stretch}")
    return events


def _stretch_us(log: Path, start_s: float, end_s: float | None, length_us: int) -> tuple[int, int]:
    """Return first and last moment that are replayed (us) of a log of this length."""
    from koopman_lab.units import US_PER_S

    length_s = length_us / US_PER_S
    if not 0.0 <= start_s <= length_s:
        raise ConfigError(f"--start {start_s:g}: {log} lasts {length_s:.1f} s; from 0 to that")
    if end_s is None:
        return round(start_s * US_PER_S), length_us
    if not start_s < end_s < math.inf:
        raise ConfigError(
            f"--end {end_s:g}: must be above --start {start_s:g}; {log} lasts {length_s:.1f} s"
        )
    return round(start_s * US_PER_S), min(round(end_s * US_PER_S), length_us)


def _chosen(
    log: Path, events: list[Event], due_us: list[int], patterns: list[str] | None
) -> tuple[list[Event], list[int]]:
    """Return the events of the channels that are asked for, and when they are due (us)."""
    from fnmatch import fnmatchcase

    if not patterns:
        return events, due_us
    names = sorted({event.channel for event in events})
    chosen: set[str] = set()
    for pattern in patterns:
        matching = {name for name in names if fnmatchcase(name, pattern)}
        if not matching:
            raise LogError(f"{log}: no channel is --only {pattern}; there are: {', '.join(names)}")
        chosen |= matching
    kept = [k for k, event in enumerate(events) if event.channel in chosen]
    return [events[k] for k in kept], [due_us[k] for k in kept]


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
