"""An hour of driving in which something breaks every 20 s, judged by the robot's true motion."""

from __future__ import annotations

import math
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.errors import LabError
from koopman_lab.geometry.planar import Pose
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.bench.faults.bounds import ON_THE_WAY_S, ramp_s
from offboard.bench.faults.stage import FAST_M_PER_S, MOVES_M_PER_S, TruthSample, is_at_rest
from offboard.bench.soak.permission import Permission, forbidden_way_m
from offboard.bench.soak.resources import Resources, ResourceWatch
from offboard.bench.soak.standing_lab import ROBOT, StandingLab
from offboard.bench.soak.strikes import WATCHED_S, Strike, strikes_for
from offboard.desk.floor import excess_m

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.lab.run_folder import RunFolder

BUSY_S = 0.5
"""What other processes on the machine may hold a message up, on top of each bound."""
SETTLED_S = 1.0
"""The robot is watched for so long after the end of a session."""
UNDER_WAY_S = 40.0
"""In which a session has the robot driven, or waits for something and is ended."""
MOST_DELAY_S = 1.5
SHORT_PAUSE = ("--set", "controller.pause_limit_s=2")
EASY_DRAWS = (
    *("--set", "sampler.draw_set.x1_m=[0.3, 0.9]"),
    *("--set", "sampler.draw_set.x2_m=[-0.3, 0.3]"),
)
NEAREST_M, FARTHEST_M = 1.2, 1.8
"""Of the starts of parks from the goal: far enough to be struck on the way, on the floor."""


@dataclass(frozen=True)
class Struck:
    """What one strike led to.

    Attributes
    ----------
    strike, activity
        What went wrong, and while the robot did what.
    under_way
        Whether the robot drove when it was struck; a lie may have kept it from starting.
    stood_after_s
        From the strike until the robot stood for good; None if it drove on until the session ended.
    bound_s
        The time in which it had to; None if it might drive on.
    forbidden_m
        Way that it drove without permission.
    beyond_floor_m
        How far it was beyond the floor at most.
    lost
        Messages missing in the session log.
    code
        Exit code of the session.
    """

    strike: str
    activity: str
    under_way: bool
    stood_after_s: float | None
    bound_s: float | None
    forbidden_m: float
    beyond_floor_m: float
    lost: int
    code: int


@dataclass(frozen=True)
class Soaked:
    """What an hour brought: each strike, and what the processes held at its begin and end."""

    strikes: list[Struck]
    resources: list[Resources]
    driven_m: float


def soak(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    model: Path,
    seconds: float,
    every_s: float,
    report: Callable[[float, str], None],
) -> Soaked:
    """Strike a lab again and again; each kind once before one comes again.

    Parameters
    ----------
    config
        The lab; its seed draws what breaks, when, and from where the robot is parked.
    folder
        Of this run; the sessions' own folders are in it and are removed when they were counted.
    listener
        Of this process.
    model
        Parks the robot.
    seconds
        For how long.
    every_s
        From one strike to the next at least.
    report
        Told the seconds that have passed, and what broke last.

    Raises
    ------
    LabStateError
        If the lab does not come back after a strike.
    """
    rng, watch = random.Random(config.seed), ResourceWatch()
    lab = StandingLab(config, folder, listener)
    table = strikes_for(robot_type(config.robot.kind))
    left: list[Strike] = []
    struck: list[Struck] = []
    driven_m, begun_us = 0.0, listener.now_us()
    try:
        while (passed_s := (listener.now_us() - begun_us) / US_PER_S) < seconds:
            if not left:
                left = rng.sample(table, len(table))
            strike, due_us = left.pop(), listener.now_us() + every_s * US_PER_S
            report(passed_s, strike.name)
            driven, row = _cycle(lab, strike, folder, model, rng)
            driven_m += driven
            struck.append(row)
            for name, pid in lab.pids.items():
                watch.look(name, pid)
            lab.spin(max(0.0, (due_us - listener.now_us()) / US_PER_S))
    finally:
        lab.close()
    return Soaked(struck, watch.longest(), driven_m)


def _cycle(
    lab: StandingLab, strike: Strike, folder: RunFolder, model: Path, rng: random.Random
) -> tuple[float, Struck]:
    """Let a session drive, strike it, and watch; return the way driven (m) and what happened."""
    config, half_track_m = lab.config, 0.5 * lab.config.robot.track_width_m
    lab.revive(*ROBOT, "view")
    lab.release()
    for fault in strike.wrong:
        lab.inject(fault, UNDER_WAY_S + WATCHED_S)
    session = folder.path / "session"
    shutil.rmtree(session, ignore_errors=True)
    shutil.rmtree(session.with_name("second"), ignore_errors=True)
    lab.sights.clear()
    begun_us = lab.listener.now_us()
    lab.begin(*_session(strike, folder, session, model, rng))
    fast = _moves if strike.wrong else _is_fast
    lab.spin(UNDER_WAY_S, lambda: lab.ended or any(map(fast, lab.sights[-10:])))
    under_way = not lab.ended and any(map(fast, lab.sights[-10:]))
    if not strike.wrong:
        lab.spin(rng.uniform(0.0, MOST_DELAY_S), lambda: lab.ended)
    struck_us = lab.listener.now_us()
    if not lab.ended:
        strike.act(lab, session)
    lab.spin(WATCHED_S - (lab.listener.now_us() - struck_us) / US_PER_S, lambda: lab.ended)
    lab.spin(SETTLED_S)
    code = lab.end()
    ended_us = lab.listener.now_us()
    lab.spin(SETTLED_S)
    for fault in strike.faults:
        lab.inject(fault, 0.0)
    bound_s = None if strike.bound is None else strike.bound(config)
    end_us = ended_us + (ramp_s(config) + ON_THE_WAY_S) * US_PER_S
    if bound_s is not None and under_way:
        end_us = min(end_us, struck_us + (bound_s + BUSY_S) * US_PER_S)
    sights = list(lab.sights)
    after = [sight for sight in sights if sight.utime >= struck_us]
    moved_us = max((s.utime for s in after if not is_at_rest(s)), default=struck_us)
    row = Struck(
        strike.name,
        strike.activity,
        under_way,
        (moved_us - struck_us) / US_PER_S if moved_us < ended_us else None,
        bound_s,
        forbidden_way_m(sights, [Permission(begun_us, end_us)], half_track_m),
        max((excess_m(config.floor, s.x1_m, s.x2_m) for s in sights), default=0.0),
        _lost(session),
        code,
    )
    return forbidden_way_m(sights, (), half_track_m), row


def _session(
    strike: Strike, folder: RunFolder, session: Path, model: Path, rng: random.Random
) -> list[str | Path]:
    common: list[str | Path] = ["--config", folder.config, "--out", session]
    if strike.activity == "calibrate":
        return ["calibrate", "--segments", "2", *EASY_DRAWS, *SHORT_PAUSE, *common]
    x1 = -rng.uniform(NEAREST_M, FARTHEST_M)
    start = Pose(x1, rng.uniform(-0.5, 0.5), rng.uniform(-0.8, 0.8))
    typed = [f"{value:.3f}" for value in (start.x1, start.x2, math.degrees(start.theta))]
    return ["park", "--model", model, "--start", *typed, *SHORT_PAUSE, *common]


def _is_fast(sight: TruthSample) -> bool:
    return abs(sight.v_m_per_s) >= FAST_M_PER_S


def _moves(sight: TruthSample) -> bool:
    return abs(sight.v_m_per_s) >= MOVES_M_PER_S


def _lost(session: Path) -> int:
    """Return how many messages are missing in a log, that of a killed logger included."""
    from koopman_lab.data.decode import SessionLog

    try:
        return sum(flow.lost for flow in SessionLog(session, salvage=True).channels.values())
    except LabError:
        # Refused before anything was recorded.
        return 0
