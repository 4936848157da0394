"""What the page offers to start with: robots, models, sessions, and the rows of our tables."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from koopman_lab.config.cost_table import COSTS
from koopman_lab.config.presets import Preset
from koopman_lab.config.schema import LabConfig
from koopman_lab.koopman.dictionary import DICTIONARIES
from koopman_lab.robots.table import ROBOTS
from offboard.lab.run_history import PastModel, PastRun
from offboard.monitor.state_in_words import GOOD
from offboard.terminal.options import ShapeName
from offboard.viewer.tasks import Choice

UNUSABLE = "unusable"
"""The verdict with which a model drives no robot."""
SIMULATED = {
    Preset.lab: "a robot a little off",
    Preset.harsh: "three times as far off",
    Preset.ideal: "the paper's equations",
    Preset.real: "nothing, a real robot",
}
COST_LABELS = {
    "me": "mixed exponents (me)",
    "ce": "control engineering (ce)",
    "ds": "data scientific (ds)",
}
"""As the paper calls them (section 3.3)."""
NUMBERED = re.compile(r"R(\d+)")


def offers(
    config: LabConfig,
    robots: Mapping[str, str],
    runs: Sequence[PastRun],
    models: Sequence[PastModel],
    root: Path,
    *,
    as_configured: bool,
) -> dict[str, list[Choice]]:
    """Return what can be chosen, by the sources that the fields of the tasks name.

    Parameters
    ----------
    config
        Of the page.
    robots
        Who is alive, with its kind; empty where nobody knows that.
    runs, models
        What lies in the folder of runs.
    root
        That folder, which labels leave out.
    as_configured
        Whether a file says which kind of robot it is and what is simulated.
    """
    kinds = [config.robot.kind] if as_configured else _default_first(ROBOTS.names(), config)
    presets = [] if as_configured else list(SIMULATED)
    return {
        "robots": _robots(config.robot.name, robots),
        "kinds": [Choice(kind, kind, kind) for kind in kinds],
        "presets": [Choice(p.value, f"{SIMULATED[p]} ({p.value})") for p in presets],
        "costs": [Choice(cost, COST_LABELS.get(cost, cost)) for cost in COSTS.names()],
        "shapes": [Choice(shape.value, shape.value) for shape in ShapeName],
        "dictionaries": [Choice(d.name, d.name, d.kind) for d in DICTIONARIES.values()],
        "models": [
            Choice(str(m.file), f"{m.file.relative_to(root)} ({_facts(m)})", m.robot)
            for m in models
            if m.verdict != UNUSABLE
        ],
        "sessions": [
            Choice(str(r.folder), f"{r.folder.relative_to(root)} ({r.robot})", r.robot)
            for r in runs
            if r.log and r.what == "calibrate" and r.outcome.tone == GOOD
        ],
        "logs": [
            Choice(str(r.folder), f"{r.folder.relative_to(root)}: {r.outcome.word}")
            for r in runs
            if r.log
        ],
    }  # fmt: skip


def _facts(model: PastModel) -> str:
    return ", ".join(filter(None, (model.robot, model.name, model.verdict)))


def _default_first(kinds: Sequence[str], config: LabConfig) -> list[str]:
    return sorted(kinds, key=lambda kind: kind != config.robot.kind)


def _robots(configured: str, alive: Mapping[str, str]) -> list[Choice]:
    """Return the robots that are alive, the configured one, and a name that nobody has."""
    choices = [
        Choice(name, f"{name} ({kind or 'alive'})", kind) for name, kind in sorted(alive.items())
    ]
    if configured not in alive:
        return [*choices, Choice(configured, f"{configured} (to start)")]
    taken = {int(match[1]) for name in alive if (match := NUMBERED.fullmatch(name))}
    free = next(number for number in range(1, len(taken) + 2) if number not in taken)
    return [*choices, Choice(f"R{free}", f"R{free} (another one)")]
