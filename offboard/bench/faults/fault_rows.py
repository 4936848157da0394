"""`klab bench faults`: runs the lab through every fault, and measures what the true robot does."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import wheel_speeds
from koopman_lab.robots.table import robot_type
from koopman_lab.units import US_PER_S
from offboard.bench.faults.scenario import Scenario
from offboard.bench.faults.scenarios import SCENARIOS
from offboard.bench.faults.stage import Stage, is_at_rest, rolled_m
from offboard.desk.floor import excess_m

LOG = "session.lcm"
STANDS_S = 1.0
"""A robot that has not moved for so long stands."""


@dataclass(frozen=True)
class Row:
    """One row of the table: what one fault led to.

    Attributes
    ----------
    fault, activity
        What went wrong, and while the robot did what.
    states
        Of the motor loop after it, one after another.
    refused
        Commands refused after it, by reason.
    latched
        Whether only a person can release the robot.
    stood_after_s
        Time from the fault until the robot stood and went on standing; None if it drives on.
    bound_s
        Time within which it had to; None if it has to drive on.
    rolled_m
        Way after the fault, until it stood.
    fastest_wheel_rad_per_s
        Largest true speed of a wheel after the fault.
    beyond_floor_m
        How far the robot was beyond the floor at most.
    session
        Whether it goes on, has ended, or its process has died.
    told
        What the operator reads at its end.
    """

    fault: str
    activity: str
    states: tuple[str, ...]
    refused: dict[str, int]
    latched: bool
    stood_after_s: float | None
    bound_s: float | None
    rolled_m: float
    fastest_wheel_rad_per_s: float
    beyond_floor_m: float
    session: str
    told: str


def run_scenario(scenario: Scenario, config: LabConfig) -> Row:
    """Run one scenario from rest.

    Raises
    ------
    LabStateError
        If the robot did not drive in the first place.
    """
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(config, scenario.activity, Path(folder) / LOG, scenario.wrong)
        try:
            if scenario.wrong:
                stage.until_moving()
            else:
                stage.until_fast()
            refused = dict(stage.onboard.loop.arbiter.counts.refused)
            struck_us = stage.lab.now_us
            scenario.strike(stage)
            stage.run(scenario.watched_s)
            return _row(scenario, stage, struck_us, refused)
        finally:
            stage.close()


def run_scenarios(
    config: LabConfig, only: str, on_progress: Callable[[float, float, str], None]
) -> list[Row]:
    """Run every scenario whose name contains ``only``."""
    robot = robot_type(config.robot.kind)
    scenarios = [s for s in SCENARIOS if only in s.name and s.is_for(robot)]
    rows = []
    for done, scenario in enumerate(scenarios):
        on_progress(done, len(scenarios), scenario.name)
        rows.append(run_scenario(scenario, config))
    on_progress(len(scenarios), len(scenarios), "")
    return rows


def as_table(rows: list[Row], kind: str) -> Any:
    """Return the rows for a person."""
    from rich.table import Table

    # For a terminal of 80 columns: these leave room for the longest word, RIGHT_WHEEL_STUCK.
    table = Table(title=f"faults of the {kind} robot")
    table.add_column("fault", max_width=18, overflow="fold")
    for column in ("stands\nafter\n(s)", "allow-\ned (s)", "rolls\n(cm)", "wheel\n(rad/s)"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("motor loop, and what the operator reads", overflow="fold")
    for row in rows:
        refused = ", ".join(f"{n} x {reason}" for reason, n in row.refused.items())
        states = " > ".join(row.states) + (f"; refuses {refused}" if refused else "")
        table.add_row(
            row.fault if row.activity == "park" else f"{row.fault} ({row.activity})",
            "drives\non" if row.stood_after_s is None else f"{row.stood_after_s:.2f}",
            "" if row.bound_s is None else f"{row.bound_s:.2f}",
            f"{100.0 * row.rolled_m:.1f}",
            f"{row.fastest_wheel_rad_per_s:.1f}",
            f"{states}\n{row.told or row.session}",
        )
    return table


def _row(scenario: Scenario, stage: Stage, struck_us: int, refused: Mapping[Any, int]) -> Row:
    loop, robot = stage.onboard.loop, stage.config.robot
    sights = [sight for sight in stage.witness.sights if sight.utime >= struck_us]
    moved_us = max((sight.utime for sight in sights if not is_at_rest(sight)), default=struck_us)
    stands = sights[-1].utime - moved_us >= STANDS_S * US_PER_S
    speeds = [
        wheel_speeds(s.v_m_per_s, s.omega_rad_per_s, robot.wheel_radius_m, robot.track_width_m)
        for s in sights
    ]
    more = {reason: n - refused[reason] for reason, n in loop.arbiter.counts.refused.items()}
    return Row(
        scenario.name,
        scenario.activity,
        tuple(stage.states),
        {reason: n for reason, n in more.items() if n},
        loop.state.name in ("ESTOP", "FAULT"),
        (moved_us - struck_us) / US_PER_S if stands else None,
        None if scenario.bound is None else round(scenario.bound(stage.config), 3),
        rolled_m(sights),
        max(abs(speed) for both in speeds for speed in both),
        max(excess_m(stage.config.floor, sight.x1_m, sight.x2_m) for sight in stage.witness.sights),
        stage.session,
        stage.told,
    )
