"""The jobs that a page has started: one runs, others wait, and how each ended is kept.

A pure component: it starts nothing and knows no clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from koopman_lab.errors import LabStateError
from offboard.monitor.state_in_words import ACTIVE, GOOD, IDLE, StateInWords

MOST_WAITING = 8
WAITING = StateInWords("waiting", IDLE)
MOST_KEPT = 20
"""Jobs that have ended; their run folders stay."""


class Stage(str, Enum):
    """Where a job is."""

    waiting = "waiting"
    running = "running"
    ended = "ended"


@dataclass(frozen=True)
class Job:
    """One job.

    Attributes
    ----------
    number
        Counts the jobs of this page.
    task
        Name of the task.
    arguments
        Of the command.
    uses
        What it uses, as a person reads it, by the label.
    drives
        Whether it drives a robot.
    asked_s
        When it was asked for (s since 1970).
    stage
        Where it is.
    folder
        Its run folder; empty where it has none.
    began_s, ended_s
        When it began and ended (s since 1970).
    note
        What its command said last.
    state
        How it is, or how it ended.
    stopping
        Whether it was asked to end.
    """

    number: int
    task: str
    arguments: tuple[str, ...]
    uses: Mapping[str, str] = field(default_factory=dict)
    drives: bool = False
    asked_s: float = 0.0
    stage: Stage = Stage.waiting
    folder: str = ""
    began_s: float | None = None
    ended_s: float | None = None
    note: str = ""
    state: StateInWords = WAITING
    stopping: bool = False


class JobQueue:
    """Says what runs, what comes next, and how everything ended."""

    def __init__(self) -> None:
        self._jobs: dict[int, Job] = {}
        self._count = 0
        self.version = 0
        """Counts what has changed."""

    @property
    def running(self) -> Job | None:
        """Return the job that runs, None if none does."""
        return next(iter(self._at(Stage.running)), None)

    def jobs(self) -> list[Job]:
        """Return all jobs: what runs and waits, in order, then what has ended, the newest first."""
        ended = sorted(self._at(Stage.ended), key=lambda job: job.ended_s or 0.0, reverse=True)
        return [*self._at(Stage.running), *self._at(Stage.waiting), *ended]

    def add(
        self,
        task: str,
        arguments: Sequence[str],
        uses: Mapping[str, str],
        *,
        drives: bool,
        now_s: float,
    ) -> Job:
        """Let a job wait for its turn.

        Raises
        ------
        LabStateError
            If too many wait.
        """
        if len(self._at(Stage.waiting)) == MOST_WAITING:
            raise LabStateError(
                f"{MOST_WAITING} runs wait already, the most there may be; remove one of them"
            )
        self._count += 1
        job = Job(self._count, task, tuple(arguments), dict(uses), drives, now_s)
        self._put(job)
        return job

    def next(self) -> Job | None:
        """Return the job whose turn it is; None where one runs, or none waits."""
        return None if self.running else next(iter(self._at(Stage.waiting)), None)

    def begin(self, number: int, folder: str, now_s: float) -> None:
        """Note that a job runs."""
        state = StateInWords("running", ACTIVE)
        self._change(number, stage=Stage.running, folder=folder, began_s=now_s, state=state)

    def note(self, number: int, text: str) -> None:
        """Note what a running job said last."""
        if self._jobs[number].note != text:
            self._change(number, note=text)

    def stop(self, number: int) -> None:
        """Note that a running job was asked to end."""
        state = StateInWords("ending", ACTIVE, "it was asked to end")
        self._change(number, state=state, stopping=True)

    def end(self, number: int, state: StateInWords, now_s: float) -> None:
        """Note how a job ended.

        What waits for it does not begin unless it went well: nothing is driven behind the back of
        somebody who has just read that something went wrong.
        """
        self._change(number, stage=Stage.ended, state=state, ended_s=now_s)
        if state.tone != GOOD:
            self.withdraw(f"the run before it ended: {state.word}", now_s)
        self._forget_oldest()

    def withdraw(self, reason: str, now_s: float) -> None:
        """Take away what waits."""
        for job in self._at(Stage.waiting):
            state = StateInWords("not started", IDLE, reason)
            self._change(job.number, stage=Stage.ended, state=state, ended_s=now_s)
        self._forget_oldest()

    def remove(self, number: int, now_s: float) -> Job:
        """Take away a job that waits; return a job that runs, which somebody has to end.

        Raises
        ------
        LabStateError
            If there is no such job, or it has ended.
        """
        job = self._jobs.get(number)
        if job is None or job.stage is Stage.ended:
            raise LabStateError("this run has ended already")
        if job.stage is Stage.waiting:
            state = StateInWords("not started", IDLE, "removed from the queue")
            self._change(number, stage=Stage.ended, state=state, ended_s=now_s)
            self._forget_oldest()
        return job

    def _at(self, stage: Stage) -> list[Job]:
        return [job for job in self._jobs.values() if job.stage is stage]

    def _forget_oldest(self) -> None:
        for job in [job for job in self.jobs() if job.stage is Stage.ended][MOST_KEPT:]:
            del self._jobs[job.number]

    def _put(self, job: Job) -> None:
        self._jobs[job.number] = job
        self.version += 1

    def _change(self, number: int, **changes: object) -> None:
        self._put(replace(self._jobs[number], **changes))  # type: ignore[arg-type]
