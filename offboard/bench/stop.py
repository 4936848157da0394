"""`klab bench stop`: from the key or the button of the page to wheels that stand."""

from __future__ import annotations

import contextlib
import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import Report, out, progress

if TYPE_CHECKING:
    from rich.table import Table

    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from offboard.bench.stop_timer import StopTimer
    from offboard.lab.run_folder import RunFolder

NOTE_WHEN = """() => {
  for (const kind of ["keydown", "click"]) {
    addEventListener(kind, () => { window.pressed = Date.now(); }, { capture: true });
  }
}"""
"""Before the page itself hears of it."""
BUTTON = "button"
WAYS = ("space bar", BUTTON)
SLOW_M_PER_S = 0.15
"""Straight ahead, the motors at zero brake the body from this in 80 ms."""
SOON_MS = 100
READY, CONFIRMED = "#line:has-text(': ')", "#said:has-text('STOP confirmed')"
FEWEST_TURNS = 50
"""Encoder messages before a press, for the robot to get under way."""
MOST_STARTS = 1000
US_PER_MS = 1000


class Stop(NamedTuple):
    """One press.

    Attributes
    ----------
    by
        What was pressed.
    v_m_per_s, omega_rad_per_s
        How fast the robot was then.
    zero_ms
        Until the motors were at zero (ms).
    stood_ms
        Until no encoder counted within a tick of the motors (ms).
    """

    by: str
    v_m_per_s: float
    omega_rad_per_s: float
    zero_ms: float
    stood_ms: float


@needs("desk")
def stop(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    robot: options.Robot = None,
    presses: Annotated[
        int, typer.Option("--presses", min=2, help="Of the key and of the button in turn.")
    ] = 40,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="FILE", help="Press while the robot is parked with this model."
        ),
    ] = None,
    url: options.Url = None,
    folder: options.Out = None,
    as_json: options.AsJson = False,
) -> None:
    """Press STOP on the page of a robot under way; show when motors are at zero and wheels stand.

    Without a model the robot weaves. Needs Chromium and the package playwright.

    Example: klab bench stop --presses 10 --model runs/model.npz
    """
    from offboard.lab.run_folder import new_folder
    from offboard.lab.session_runner import keeping_the_log

    kind = robot
    if model is not None:
        from koopman_lab.predictors.predictor import require_robot
        from koopman_lab.predictors.table import load_model

        loaded = load_model(model)
        kind = kind or (None if config else loaded.robot.name)
    lab = options.resolve(config, overrides, kind, url=url)
    if model is not None:
        require_robot(loaded, lab.robot.kind)
    listener = options.listen(lab)
    run = new_folder(folder, "stop", lab)
    with keeping_the_log(run), progress("pressing", "stops") as report:
        stops = _press(lab, run, listener, presses, model, report)
    if as_json:
        out.print_json(json.dumps([press._asdict() for press in stops]))
    else:
        out.print(_table(stops, lab.robot.kind))
        soon = sum(press.stood_ms <= SOON_MS for press in stops)
        out.print(f"{soon} of {len(stops)} stood within {SOON_MS} ms")


def _press(
    config: LabConfig,
    folder: RunFolder,
    listener: Listener,
    presses: int,
    model: Path | None,
    report: Report,
) -> list[Stop]:
    import numpy as np

    from koopman_lab.errors import LabStateError
    from offboard.bench.browser import browser, visit
    from offboard.bench.parks import starts
    from offboard.bench.stop_drives import Drive, Parks, Weave
    from offboard.bench.stop_timer import StopTimer
    from offboard.commands.view import HOST, free_port
    from offboard.lab.supervisor import start_missing, supervised

    timer, stops = StopTimer(listener), list[Stop]()
    rng = np.random.default_rng(config.seed)
    with contextlib.ExitStack() as stack:
        lab = stack.enter_context(supervised(config, folder, listener))
        start_missing(lab, set(), folder)
        port = free_port()
        lab.start("view", "--port", str(port))
        chromium = stack.enter_context(browser())
        if chromium is None:
            raise LabStateError(
                "klab bench stop presses in a real page: install Chromium, and "
                "`pip install playwright`"
            )
        page = chromium.new_page()
        visit(page, f"http://{HOST}:{port}/")
        page.evaluate(NOTE_WHEN)
        page.locator(READY).wait_for()
        drive: Drive = Weave(lab)
        if model is not None:
            begin = itertools.cycle(starts(config, MOST_STARTS))
            drive = Parks(lab, config, listener, model, begin)
        while len(stops) < presses:
            drive.begin()
            # One that has parked before the press is sent off again.
            under_way = timer.turn(int(rng.integers(FEWEST_TURNS, drive.most_turns)))
            v, omega = timer.speeds
            by = WAYS[len(stops) % len(WAYS)]
            if by == BUTTON:
                page.locator("#stop").click()
            else:
                page.keyboard.press("Space")
            pressed_us = round(page.evaluate("window.pressed") * US_PER_MS)
            zero_us, stood_us = timer.stop_after(pressed_us)
            if under_way:
                stops.append(Stop(by, v, omega, zero_us / US_PER_MS, stood_us / US_PER_MS))
                report(len(stops), presses)
            # Until then the page goes on to stop the robot.
            page.locator(CONFIRMED).wait_for()
            drive.end()
            _release(listener, timer)
            lab.check()
    return stops


def _release(listener: Listener, timer: StopTimer) -> None:
    from koopman_lab.errors import LabStateError
    from offboard.desk.orders import WAIT_S, stop_order

    order = stop_order(lambda: timer.status, release=True)
    while (obeyed := order.step(listener)) is None:
        listener.spin(WAIT_S)
    if not obeyed:
        raise LabStateError("the motor loop does not confirm the release; see its process log")


def _table(stops: list[Stop], kind: str) -> Table:
    import numpy as np
    from rich.table import Table

    table = Table("ms", title=f"STOP on the page, {kind} robot")
    for column in ("presses", "p50", "p99", "max"):
        table.add_column(column, justify="right")
    slow = [press for press in stops if abs(press.v_m_per_s) <= SLOW_M_PER_S]
    rows = [
        *((f"{by}: motors at zero", [s.zero_ms for s in stops if s.by == by]) for by in WAYS),
        *((f"{by}: wheels stand", [s.stood_ms for s in stops if s.by == by]) for by in WAYS),
        (f"wheels stand, from at most {SLOW_M_PER_S:g} m/s", [s.stood_ms for s in slow]),
        ("wheels stand, from more", [s.stood_ms for s in stops if s not in slow]),
    ]
    for what, values in rows:
        spread = np.percentile(values, [50, 99, 100]).tolist() if values else ()
        table.add_row(what, str(len(values)), *(f"{value:.0f}" for value in spread))
    return table
