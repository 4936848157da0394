"""`klab bench edmd`: what a fit costs, in time and memory."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopman_lab.errors import LabStateError
from koopman_lab.robots.dynamic import DYNAMIC
from offboard.bench.dataset_time import PAPER_PAIRS
from offboard.lab.python_process import module_command
from offboard.terminal import options
from offboard.terminal.needs import needs
from offboard.terminal.output import out

if TYPE_CHECKING:
    from numpy.typing import NDArray

DICTIONARY = "D8Eul"
STREAMED_PAIRS = 10_000_000
BATCH = 50_000
"""Pairs at once in the stream: as many as a session of some minutes has."""
WAYS = {
    "fit": "fit of lifted pairs (QR)",
    "pykoop": "pykoop.Edmd, the same pairs",
    "gram": "one BLAS Gram matrix, the same pairs",
    "lift": "lifting the pairs",
}


@needs("edmd")
def edmd(
    repetitions: Annotated[
        int, typer.Option("--repetitions", min=1, help="How often each is timed.")
    ] = 20,
    pairs: Annotated[int, typer.Option("--pairs", min=1000, help="Of one fit.")] = PAPER_PAIRS,
    streamed: Annotated[
        int, typer.Option("--streamed", min=0, help="Pairs in batches; 0: leave out.")
    ] = STREAMED_PAIRS,
    as_json: options.AsJson = False,
) -> None:
    """Time a fit of the paper's size against pykoop and a Gram matrix; stream many pairs.

    Each way runs in a process of its own, so that peak memory is that of one way alone.

    Example: klab bench edmd --repetitions 20
    """
    facts: dict[str, Any] = {"dictionary": DICTIONARY, "pairs": pairs, "repetitions": repetitions}
    for way in WAYS:
        facts[way] = _measure_apart(way, pairs, repetitions)
    for other in ("pykoop", "gram"):
        facts[f"fit_to_{other}"] = {
            "time": facts["fit"]["time_s"]["median"] / facts[other]["time_s"]["median"],
            "memory": facts["fit"]["peak_bytes"] / max(facts[other]["peak_bytes"], 1),
        }
    if streamed:
        facts["streamed"] = _measure_apart("stream", streamed, 1)
    if as_json:
        out.print_json(json.dumps(facts))
        return
    _show(facts)


def _measure_apart(way: str, pairs: int, repetitions: int) -> dict[str, Any]:
    """Measure one way in a process of its own."""
    command_line = module_command(__name__, way, str(pairs), str(repetitions))
    completed = subprocess.run(command_line, capture_output=True, text=True, check=False)
    if completed.returncode:
        last = (completed.stderr.strip().splitlines() or ["no message"])[-1]
        raise LabStateError(
            f"bench edmd: {way} failed ({last}); pykoop comes with the extra: "
            "pip install 'koopman-lab[test]'"
        )
    facts: dict[str, Any] = json.loads(completed.stdout)
    return facts


def measure(way: str, pairs: int, repetitions: int) -> dict[str, Any]:
    """Return times (s) and the memory (bytes) that a way took beyond what its pairs take."""
    import numpy as np

    from koopman_lab.koopman.dictionary import dictionary
    from koopman_lab.koopman.fit import fit_matrix

    if way == "stream":
        return _stream(pairs)
    lifting = dictionary(DICTIONARY, DYNAMIC.name)
    X, Y = _pairs(pairs, 0)
    psi_x, psi_y = lifting.lift(X), lifting.lift(Y)
    ways: dict[str, Callable[[], Any]] = {
        "fit": lambda: fit_matrix(psi_x, psi_y),
        "gram": lambda: psi_x.T @ psi_x,
        "lift": lambda: (lifting.lift(X), lifting.lift(Y)),
    }
    if way == "pykoop":
        import pykoop

        ways["pykoop"] = lambda: pykoop.Edmd().fit(psi_x, psi_y)
    run = ways[way]
    peak = _peak_of(run)
    times = []
    for _ in range(repetitions):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    median, p99, largest = np.percentile(times, [50.0, 99.0, 100.0]).tolist()
    return {"time_s": {"median": median, "p99": p99, "max": largest}, "peak_bytes": peak}


def _peak_of(run: Callable[[], Any]) -> int:
    """Return the most bytes that numpy held at once while something ran."""
    import tracemalloc

    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def _stream(pairs: int) -> dict[str, Any]:
    from koopman_lab.koopman.dictionary import dictionary
    from koopman_lab.koopman.fit import fit_moments
    from koopman_lab.koopman.moments import Moments

    lifting = dictionary(DICTIONARY, DYNAMIC.name)
    moments = Moments(lifting.size)
    began, fitting, early = time.perf_counter(), 0.0, 0
    for number, start in enumerate(range(0, pairs, BATCH)):
        X, Y = _pairs(min(BATCH, pairs - start), number)
        started = time.perf_counter()
        moments.add(lifting.lift(X), lifting.lift(Y), segments=1)
        fitting += time.perf_counter() - started
        if number == 3:
            early = _peak_rss()
    fit_moments(moments)
    return {
        "pairs": moments.samples,
        "total_s": time.perf_counter() - began,
        "fitting_s": fitting,
        "peak_rss_bytes": _peak_rss(),
        "peak_rss_after_four_batches_bytes": early,
    }


def _peak_rss() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _pairs(count: int, seed: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return random states (d, 5) of the second-order robot and their successors."""
    import numpy as np

    rng = np.random.default_rng(seed)
    X = rng.uniform([0.0, -0.75, -np.pi, 0.0, -1.0], [1.5, 0.75, np.pi, 0.4, 1.0], (count, 5))
    Y = DYNAMIC.step(X, np.broadcast_to([0.2, 0.5], (count, 2)), 0.05)
    return X, Y + 1e-4 * rng.normal(size=Y.shape)


def _show(facts: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(
        "", title=f"{facts['pairs']} pairs, {facts['dictionary']}, {facts['repetitions']} times"
    )
    for column in ("median ms", "p99 ms", "max ms", "peak MB"):
        table.add_column(column, justify="right")
    for way, name in WAYS.items():
        measured = facts[way]
        times = (f"{1e3 * measured['time_s'][c]:.1f}" for c in ("median", "p99", "max"))
        table.add_row(name, *times, f"{measured['peak_bytes'] / 1e6:.1f}")
    out.print(table)
    for other in ("pykoop", "gram"):
        ratio = facts[f"fit_to_{other}"]
        out.print(
            f"fit : {other} = {ratio['time']:.2f} in time, {ratio['memory']:.2g} in peak memory"
        )
    if "streamed" in facts:
        measured = facts["streamed"]
        out.print(
            f"{measured['pairs']} pairs in batches of {BATCH}: {measured['fitting_s']:.1f} s "
            f"lifting and fitting, peak RSS {measured['peak_rss_bytes'] / 1e6:.0f} MB "
            f"({measured['peak_rss_after_four_batches_bytes'] / 1e6:.0f} MB after four batches)"
        )


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))  # noqa: T201
