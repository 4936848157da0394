"""The steps from nothing to the paper's numbers, a `klab` command each."""

from __future__ import annotations

from dataclasses import dataclass

from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from offboard.reproduction.step_runner import Step

DICTIONARIES = ("D8Eul", "D10m", "D13t", "D12f")
SLOW, BASELINE = "kinematic-slow-model/model.npz", "D8Eul/D8Eul.npz"
"""Models that several steps use: of the kinematic robot at 0.1 s, of the second-order one."""
WINDOWS = "1,10,30,40,50,100"
PARALLEL = ("--start", "0", "0.5", "0")
QUADRATIC = ("--cost", "ce", "--cost", "ds")
LONG_HORIZON = 100


@dataclass(frozen=True)
class Size:
    """How much is run.

    ``segments`` for each basis input of the second-order robot (the kinematic one has the paper's
    five always), ``runs`` of each reference trajectory, ``starts`` of the parking studies,
    ``efficiency_starts`` for each number of samples, ``other_starts`` of the studies that the paper
    does not have, ``factors`` of the study of weights, ``repetitions`` of `klab dataset needed`.
    """

    segments: int
    runs: int
    starts: int
    efficiency_starts: int
    other_starts: int
    factors: str
    repetitions: int

    @property
    def in_words(self) -> str:
        """Return how much is run in words."""
        return (
            f"{self.segments} segments for each basis input of the second-order robot, {self.runs} "
            f"runs of each reference trajectory, {self.starts} random starts for each controller, "
            f"{self.efficiency_starts} for each number of samples and {self.other_starts} in the "
            "other studies."
        )


FULL = Size(100, 20, 1000, 1000, 200, "0.1,1,10", 20)
QUICK = Size(30, 5, 40, 16, 8, "1,10", 2)


def steps(size: Size, seed: int) -> list[Step]:
    """Return the steps in order, each behind those it needs.

    Parameters
    ----------
    size
        How much is run.
    seed
        Of the sessions, the lab runs and the starts.
    """
    return [*judged_steps(size, seed), *_beyond(size, seed)]


def judged_steps(size: Size, seed: int) -> list[Step]:
    """Return the steps that the verdicts rest on, the first of :func:`steps`."""
    return [*_kinematic(seed), *_dynamic(size, seed), *_studies(size, seed)]


def _step(
    name: str, *arguments: str | int, resumable: bool = False, parallel: bool = False
) -> Step:
    return Step(name, tuple(map(str, arguments)), resumable, parallel)


def _kinematic(seed: int) -> list[Step]:
    model = "kinematic-model/model.npz"
    lab = ("--lockstep", "--seed", seed)
    simulate = ("simulate", "--model", SLOW)
    return [
        _step(
            "kinematic-session",
            *("calibrate", "--robot", KINEMATIC.name, *lab, "--out", "kinematic-session"),
        ),
        _step("kinematic-model", "train", "kinematic-session", "--out", model),
        _step("kinematic-slow-model", "train", "kinematic-session", "--dt", "0.1", "--out", SLOW),
        _step(
            "simulation-models",
            *(*simulate, "--predict", "nominal", "--predict", "reprojected"),
            *("--predict", "lifted", "--out", "simulation-models"),
        ),
        _step(
            "simulation-parallel",
            *(*simulate, *PARALLEL, "--cost", "me", *QUADRATIC, "--out", "simulation-parallel"),
        ),
        _step(
            "simulation-parallel-lifted",
            *(*simulate, *PARALLEL, "--predict", "lifted"),
            *("--out", "simulation-parallel-lifted"),
        ),
        _step("kinematic-lab", "compare", "--model", model, *lab, "--out", "kinematic-lab"),
    ]


def _dynamic(size: Size, seed: int) -> list[Step]:
    robot = ("--robot", DYNAMIC.name, "--lockstep", "--seed", seed)
    models = [f"{name}/{name}.npz" for name in DICTIONARIES]
    simulate = ("simulate", "--model", BASELINE)

    def drive(name: str, shape: str, kind: str) -> Step:
        return _step(
            name,
            *("reference", "--shape", shape, "--runs", size.runs, "--robot", kind, "--lockstep"),
            # Other draws than those of the session that the models learn from.
            *("--seed", seed + 1, "--out", name),
        )

    return [
        _step(
            "dynamic-session",
            *("calibrate", *robot, "--segments", size.segments, "--out", "dynamic-session"),
        ),
        drive("dynamic-infinity", "infinity", DYNAMIC.name),
        drive("dynamic-square", "square", DYNAMIC.name),
        drive("kinematic-infinity", "infinity", KINEMATIC.name),
        *(
            _step(name, "train", "dynamic-session", "--dictionary", name, "--out", file)
            for name, file in zip(DICTIONARIES, models, strict=True)
        ),
        _step("samples", "figure", "samples", "dynamic-session", "--out", "samples/samples"),
        _step(
            "sweep",
            *("dataset", "sweep", "dynamic-session", "--windows", WINDOWS, "--out", "sweep/sweep"),
        ),
        _step(
            "dictionaries",
            *("figure", "dictionaries", *models, "dynamic-infinity", "dynamic-square"),
            *("--out", "dictionaries/dictionaries"),
        ),
        _step(
            "multistep",
            *("figure", "multistep", BASELINE, "dynamic-infinity", "--out", "multistep/multistep"),
        ),
        _step(
            "validation",
            "validate",
            *models,
            "dynamic-infinity",
            "dynamic-square",
            "--out",
            "validation",
        ),
        _step(
            "kinematic-validation",
            *("validate", "kinematic-model/model.npz", "kinematic-infinity"),
            *("--out", "kinematic-validation"),
        ),
        _step(
            "simulation-dynamic",
            *(*simulate, "--cost", "me", *QUADRATIC, "--out", "simulation-dynamic"),
        ),
        _step(
            "simulation-dynamic-long",
            *(*simulate, *QUADRATIC, "--predict", "nominal", "--predict", "reprojected"),
            *("--set", f"controller.horizon={LONG_HORIZON}", "--out", "simulation-dynamic-long"),
        ),
        _step(
            "dynamic-lab",
            *("compare", "--model", BASELINE, "--lockstep", "--seed", seed),
            *("--out", "dynamic-lab"),
        ),
        _step(
            "needed",
            *("dataset", "needed", "dynamic-session", "--repetitions", size.repetitions),
            *("--out", "needed/needed"),
        ),
    ]


def _study(name: str, runs: int, seed: int, *arguments: str) -> Step:
    return _step(
        name,
        *("study", name, *arguments, "--runs", str(runs), "--seed", str(seed), "--out", name),
        resumable=True,
        parallel=True,
    )


def _studies(size: Size, seed: int) -> list[Step]:
    sessions = ("--dataset-kinematic", "kinematic-session", "--dataset-dynamic", "dynamic-session")
    return [
        _study("kinematic-parking", size.starts, seed, "--model", SLOW),
        _study("dynamic-parking", size.starts, seed, "--model", BASELINE),
        _study("data-efficiency", size.efficiency_starts, seed, *sessions),
        _step(
            "weights-kinematic",
            *("study", "weights", "--model", SLOW, *PARALLEL, "--factors", size.factors),
            *("--out", "weights-kinematic/weights-kinematic.csv"),
        ),
        _step(
            "weights-dynamic",
            *("study", "weights", "--model", BASELINE, "--factors", size.factors),
            *("--out", "weights-dynamic/weights-dynamic.csv"),
        ),
    ]


def _beyond(size: Size, seed: int) -> list[Step]:
    session = ("--dataset", "dynamic-session")
    return [
        _study("horizon", size.other_starts, seed, "--model", BASELINE),
        _study("fit", size.other_starts, seed, *session),
        _study("combination", size.other_starts, seed, *session),
    ]
