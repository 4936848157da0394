"""Who runs the runs of a study: processes of this machine, or a cluster.

Either takes chunks (a case, numbers of its runs) and hands out what they brought, in whatever order
they end.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Protocol

from koopman_lab.errors import LabStateError
from koopman_lab.installation import require
from koopman_lab.studies.parking import Case, prediction_and_solver, run

Chunk = tuple[Case, Sequence[int]]
CONNECT_S = 20.0
"""Time within which a scheduler must answer and have a worker."""
AHEAD = 4
"""Chunks sent to a cluster for each thread of its workers, so that none of them waits."""


class ChunkResult(NamedTuple):
    """What a chunk brought: its rows, and what solved in them, in words for a person."""

    rows: list[dict[str, Any]]
    solver: str


class WorkerLostError(Exception):
    """A process of the pool died; what its chunk would have brought is to be run again."""


class Pool(Protocol):
    """Runs the chunks of a study."""

    workers: int
    where: str
    """Where the runs run, in words for a person."""

    def __call__(self, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Yield what each chunk brought."""


def run_chunk(case: Case, indices: Sequence[int]) -> ChunkResult:
    """Run some runs of one case."""
    rows = [run(case, index) for index in indices]
    good = any(row["reason"] is None for row in rows)
    return ChunkResult(rows, prediction_and_solver(case)[1].description if good else "")


class Processes:
    """Processes of this machine, one thread each.

    Parameters
    ----------
    workers
        Number of processes.
    starting
        Returns what surrounds the moment in which they are started.
    """

    def __init__(
        self,
        workers: int,
        starting: Callable[[], AbstractContextManager[None]] = contextlib.nullcontext,
    ) -> None:
        self.workers = workers
        self._starting = starting
        self.where = "processes"

    def __call__(self, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Yield what each chunk brought.

        Raises
        ------
        WorkerLostError
            If a process died.
        """
        import joblib
        from joblib.externals.loky.process_executor import BrokenProcessPool

        with joblib.parallel_config("loky", n_jobs=self.workers, inner_max_num_threads=1):
            pool = joblib.Parallel(return_as="generator_unordered", batch_size=1)
            try:
                with self._starting():
                    results = pool(joblib.delayed(run_chunk)(*chunk) for chunk in chunks)
                yield from results
            except BrokenProcessPool:
                raise WorkerLostError from None


class Cluster:
    """The workers of a scheduler of dask.distributed; a worker that dies is the scheduler's affair.

    Models and configurations travel with the task. Workers need this package, in the same version,
    and a C compiler as here: without one they solve in another way.

    Parameters
    ----------
    address
        Address of the scheduler, e.g. ``tcp://192.0.2.1:8786``.
    workers
        Number of workers to wait for; those that come later join in.

    Raises
    ------
    InstallationError
        If the extra cluster is not installed.
    LabStateError
        If the scheduler does not answer or has no worker.
    """

    def __init__(self, address: str, workers: int = 1) -> None:
        require("cluster", "a scheduler of dask.distributed")
        from distributed import Client

        self.where = address
        try:
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise LabStateError(
                f"--dask {address}: no scheduler answers ({reason}); start one with "
                "`dask scheduler` and name the address it prints"
            ) from None
        try:
            self._client.wait_for_workers(workers, timeout=CONNECT_S)
        except TimeoutError:
            self._client.close()
            raise LabStateError(
                f"--dask {address}: the scheduler has no worker; start some with "
                f"`dask worker {address} --nthreads 1`"
            ) from None
        self.workers = sum(self._client.nthreads().values())

    def __call__(self, chunks: Sequence[Chunk]) -> Iterator[ChunkResult]:
        """Yield what each chunk brought.

        Raises
        ------
        LabStateError
            If the scheduler is gone, or a chunk kills one worker after the other.
        """
        from distributed import as_completed
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        waiting = iter(chunks)
        try:
            first = self._submit(itertools.islice(waiting, AHEAD * self.workers))
            futures = as_completed(first, loop=self._client.loop)
            for future in futures:
                yield future.result()
                futures.update(self._submit(itertools.islice(waiting, 1)))
        except KilledWorker as error:
            raise LabStateError(f"--dask {self.where}: {error}") from None
        except (FutureCancelledError, OSError, TimeoutError):
            raise LabStateError(f"--dask {self.where}: the scheduler is gone") from None
        finally:
            self._client.close()

    def _submit(self, chunks: Iterable[Chunk]) -> list[Any]:
        return [self._client.submit(run_chunk, *chunk, pure=False) for chunk in chunks]
