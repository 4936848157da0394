"""Runs what the page starts: `klab` commands, one after the other, and what they have come to."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabError, LabStateError
from offboard.lab.job_offers import offers
from offboard.lab.job_outcome import MODEL_NAME, job_outcome
from offboard.lab.job_process import JobProcess
from offboard.lab.run_history import PastModel, PastRun, RunHistory
from offboard.monitor.state_in_words import BAD, StateInWords
from offboard.viewer.job_queue import Job, JobQueue, Stage
from offboard.viewer.tasks import TASKS, Choice, Task

READ_S = 0.5
"""So often it is read what a command says."""
END_S = 0.05
"""So often it is looked whether a command has ended, when the page ends."""
WITHOUT_FOLDER = ("replay",)
ON_THE_BUS = ("replay",)
"""Tasks that drive nothing and speak on the bus all the same."""


class JobRunner:
    """Starts, watches and ends the commands; see :class:`~offboard.viewer.jobs.Jobs`.

    Parameters
    ----------
    config
        Of the page.
    options
        Options of the page's own command that each command which drives gets as well: the file of
        the configuration and what is set above it.
    as_configured
        Whether they say which kind of robot it is.
    root
        Folder of the runs.
    secrets
        Environment variables that no command gets.
    """

    def __init__(
        self,
        config: LabConfig,
        options: Sequence[str] = (),
        *,
        as_configured: bool = False,
        root: Path = Path("runs"),
        secrets: Sequence[str] = (),
    ) -> None:
        self._config, self._options, self._secrets = config, tuple(options), tuple(secrets)
        self._as_configured = as_configured
        self._history = RunHistory(root.absolute())
        self._queue = JobQueue()
        self._runs: list[PastRun] = []
        self._models: list[PastModel] = []
        self._robots: dict[str, str] = {}
        self._process: JobProcess | None = None
        self._read_s = 0.0
        self._looks = 0
        self._closing = False

    @property
    def version(self) -> int:
        """Count what has changed."""
        return self._queue.version + self._looks

    @property
    def _offers(self) -> dict[str, list[Choice]]:
        return offers(
            *(self._config, self._robots, self._runs, self._models, self._history.root),
            as_configured=self._as_configured,
        )

    def as_json(self) -> dict[str, Any]:
        """Return what the page shows: what is offered, queue and history."""
        jobs = [self._job_row(job) for job in self._queue.jobs()]
        shown = {job.folder for job in self._queue.jobs()}
        past = [self._past_row(run) for run in self._runs if str(run.folder) not in shown]
        begun = [row for row in jobs if row["stage"] != Stage.ended]
        ended = [row for row in jobs if row["stage"] == Stage.ended] + past
        ended.sort(key=lambda row: row["at_s"], reverse=True)
        return {
            "tasks": [task.as_json() for task in TASKS.values()],
            "offers": self._offers,
            "runs": begun + ended,
            "root": str(self._history.root),
        }

    def start(self, task: str, values: Mapping[str, Any]) -> str:
        """Let a command wait for its turn; return what to say of it.

        Raises
        ------
        LabStateError
            If there is no such task, a value is not allowed, or too many commands wait.
        """
        row = TASKS.get(task)
        if row is None:
            raise LabStateError(f"{task[:32]!r}: cannot be started from the page")
        choices = self._offers
        arguments = row.arguments(values, choices)
        uses = _uses(row, values, choices)
        busy = self._queue.running is not None
        self._queue.add(row.name, arguments, uses, drives=row.drives, now_s=time.time())
        return f"{row.label}: {'waits for its turn' if busy else 'starting'}"

    def remove(self, number: int) -> str:
        """End a job, or take it from the queue; return what to say of it.

        Raises
        ------
        LabStateError
            If it has ended.
        """
        job = self._queue.remove(number, time.time())
        label = TASKS[job.task].label
        if job.stage is Stage.waiting:
            return f"{label}: removed from the queue"
        self._queue.stop(number)
        if self._process is not None:
            self._process.ask_to_end(time.monotonic())
        return f"{label}: asked to end"

    def withdraw(self, reason: str) -> None:
        """Take away what waits."""
        self._queue.withdraw(reason, time.time())

    def heard(self, robots: Mapping[str, str]) -> None:
        """Take the names of the robots that are alive, with their kind where it is known."""
        if robots != self._robots:
            self._robots = dict(robots)
            self._looks += 1

    def step(self) -> None:
        """Look after the job that runs, and begin the next."""
        running = self._queue.running
        if running is None:
            job = None if self._closing else self._queue.next()
            if job is not None:
                self._begin(job)
            return
        assert self._process is not None  # begun with the job
        now_s = time.monotonic()
        code = self._process.poll(now_s)
        if code is None and now_s < self._read_s:
            return
        self._read_s = now_s + READ_S
        said = self._process.said()
        if code is None:
            self._queue.note(running.number, said[-1] if said else "")
            return
        self._process.close()
        self._process = None
        folder = Path(running.folder) if running.folder else None
        state = job_outcome(code, said, folder, stopped=running.stopping)
        self._queue.end(running.number, state, time.time())

    async def look(self) -> None:
        """Look what lies in the folder of runs, in a thread of its own."""
        runs, models = await asyncio.to_thread(self._history.look)
        if (runs, models) != (self._runs, self._models):
            self._runs, self._models = runs, models
            self._looks += 1

    async def close(self) -> None:
        """End the job that runs; what waits is not begun any more."""
        self._closing = True
        self.withdraw("the page has ended")
        running = self._queue.running
        if running is not None:
            self.remove(running.number)
        while self._queue.running is not None:
            self.step()
            await asyncio.sleep(END_S)

    def _begin(self, job: Job) -> None:
        folder = "" if job.task in WITHOUT_FOLDER else str(self._new_folder(job.task))
        self._queue.begin(job.number, folder, time.time())
        arguments = [*job.arguments[:1], *self._common(job, folder), *job.arguments[1:]]
        try:
            self._process = JobProcess(arguments, self._secrets)
        except (LabError, OSError) as error:
            state = StateInWords("failed", BAD, str(error))
            self._queue.end(job.number, state, time.time())

    def _common(self, job: Job, folder: str) -> list[str]:
        """Return the options that a person does not choose."""
        if job.task == "train":
            return ["--out", str(Path(folder) / MODEL_NAME)]
        url = ["--url", self._config.bus.url]
        if job.task in ON_THE_BUS:
            return url
        return [*self._options, *url, "--out", folder]

    def _new_folder(self, task: str) -> Path:
        """Return a run folder that is not there yet."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        names = (f"{stamp}-{task}{f'-{k}' if k else ''}" for k in range(1000))
        return next(path for name in names if not (path := self._history.root / name).exists())

    def _job_row(self, job: Job) -> dict[str, Any]:
        return {
            "number": job.number,
            "stage": job.stage,
            "task": job.task,
            "at_s": job.ended_s or job.began_s or job.asked_s,
            "began_s": job.began_s,
            "state": job.state._asdict(),
            "uses": dict(job.uses),
            "folder": self._shown(job.folder),
            "note": job.note,
        }

    def _past_row(self, run: PastRun) -> dict[str, Any]:
        robot = {"Kind": run.robot} if run.robot else {}
        uses = robot | {name.capitalize(): self._shown(value) for name, value in run.uses.items()}
        return {
            "number": None,
            "stage": Stage.ended,
            "task": run.what,
            "at_s": run.at_s,
            "began_s": None,
            "state": run.outcome._asdict(),
            "uses": uses,
            "folder": self._shown(str(run.folder)),
            "note": "",
        }

    def _shown(self, path: str) -> str:
        """Return a path as a person reads it: without what all runs share."""
        with contextlib.suppress(ValueError):
            return str(Path(path).relative_to(self._history.root)) if path else ""
        return path


def _uses(
    task: Task, values: Mapping[str, Any], choices: Mapping[str, Sequence[Choice]]
) -> dict[str, str]:
    """Return what a person has chosen, as a person reads it, by the label."""
    uses = {}
    for field in task.fields:
        value = values.get(field.name)
        if value is None:
            continue
        if field.source:
            labels = {choice.value: choice.label for choice in choices[field.source]}
            # That a robot is to start, or alive, says nothing of it later.
            uses[field.label] = value if field.source == "robots" else labels[value]
        else:
            numbers = value if isinstance(value, list) else [value]
            uses[field.label] = ", ".join(f"{number:g}" for number in numbers)
    return uses
