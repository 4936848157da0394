"""What a person sees: messages, and progress as a bar on a terminal or as plain lines."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import Progress as RichProgress
from rich.segment import Segment
from rich.text import Text

from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.progress_lines import Progress, progress_lines
from offboard.terminal.visible_text import one_line, visible, visible_json

if TYPE_CHECKING:
    from koopman_lab.data.decode import PassedOver
    from koopman_lab.evaluation.plausibility import Verdict
    from koopman_lab.eventlog.eventlog import Damage


class PlainConsole(Console):
    """Prints every text as it is, also in tables: names on the bus and in logs are anybody's.

    Nothing in it is markup, and what a terminal would obey is shown. Whatever is printed comes past
    :meth:`render` at the end; what is a plain text is made visible before its width is measured.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, highlight=False, soft_wrap=True, markup=False, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text as rich prints it."""
        return super().render_str(visible(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Give what is written of something; in none of it a character is left to be obeyed."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=visible(segment.text))

    def on_broken_pipe(self) -> None:
        """End where whoever read has gone, with the exit code that says so."""
        try:
            super().on_broken_pipe()
        except SystemExit:
            raise SystemExit(ExitCode.UNREAD) from None

    def print_json(self, json: str | None = None, **options: Any) -> None:
        """Print JSON, in which what does not show is written as JSON has it."""
        from rich.highlighter import JSONHighlighter
        from rich.json import JSON

        text = visible_json(JSON(json or "null", **options).text.plain)
        self.print(JSONHighlighter()(text), soft_wrap=True)


out = PlainConsole()
err = PlainConsole(stderr=True)

PLAIN_PERIOD_S = 10.0
"""Without a terminal a line this often, and at the end."""
SPEED_PERIOD_S = 300.0
"""Time left is judged by what was done in this time: segments of a session come 11 s apart."""


def show_crash(kind: type[BaseException], error: BaseException, where: Any) -> None:
    """Print the traceback of an error that nobody expected; its text may hold anybody's names."""
    import traceback

    err.print("".join(traceback.format_exception(kind, error, where)), end="")


def print_summary(file: Path) -> None:
    """Print the summary of a run as JSON, with the folder that holds it."""
    import json

    summary = json.loads(file.read_text(encoding="utf-8"))
    out.print_json(json.dumps({"folder": str(file.parent)} | summary))


def show_damage(file: Path, damage: Sequence[Damage]) -> None:
    """Say how much of a log was passed over, if anything was."""
    if damage:
        err.print(f"{file}: {sum(d.size for d in damage)} damaged bytes passed over")


def show_unreadable(file: Path, unreadable: Mapping[str, int]) -> None:
    """Say how many messages of each channel were passed over because nobody here can read them."""
    if unreadable:
        counts = ", ".join(f"{count} of {one_line(name)}" for name, count in unreadable.items())
        err.print(
            f"{file}: passed over messages of layouts unknown to this version, damaged, or of "
            f"times that cannot be: {counts}"
        )


def show_passed_over(passed_over: PassedOver | None) -> None:
    """Say what of a log was passed over, if anything was; None says nothing."""
    if passed_over is not None:
        show_damage(passed_over.file, passed_over.damage)
        show_unreadable(passed_over.file, passed_over.unreadable)


def show_verdicts(verdicts: Mapping[str, Verdict], console: Console = err) -> None:
    """Say what is made of a session, its data or a model, and why; remarks as well."""
    for name, verdict in verdicts.items():
        console.print(f"{name}: {verdict.level}")
        for reason in verdict.reasons:
            prefix = "" if reason.level == "good" else f"{reason.level}: "
            console.print(f"  {prefix}{reason.text}")


class Report(Protocol):
    """Takes how far the work is."""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        """Show ``done`` of ``total`` and a few words; ``total`` is 0 while nobody knows it."""


@contextlib.contextmanager
def progress(what: str, unit: str = "") -> Iterator[Report]:
    """Show the progress of long work inside the block: how much is done, and the time left.

    Parameters
    ----------
    what
        Is being done.
    unit
        Of how much.
    """
    if err.is_terminal:
        with _progress_bar(what, unit) as report:
            yield report
    else:
        yield _PlainProgress(what, unit)


@contextlib.contextmanager
def _progress_bar(what: str, unit: str) -> Iterator[Report]:
    with _ProgressBar(console=err, speed_estimate_period=SPEED_PERIOD_S) as bar:
        task, began = bar.add_task(visible(what), total=None, unit=visible(unit), note=""), False

        def report(done: float, total: float, note: str = "") -> None:
            nonlocal began
            if not total:
                bar.update(task, note=visible(note))
                return
            if not began:
                # What was done before, in a session that goes on, says nothing of the speed.
                bar.update(task, completed=done)
                bar.reset(task)
                began = True
            bar.update(task, completed=done, total=total, note=visible(note))

        yield report


class _ProgressBar(RichProgress):
    """Draws its tasks in lines that fit the terminal."""

    def get_renderables(self) -> Iterator[RenderableType]:
        """Give what is drawn."""
        for task in self.tasks:
            words = Progress(
                task.description,
                task.completed,
                task.total or 0.0,
                task.fields["unit"],
                task.fields["note"],
                task.time_remaining if task.total else None,
            )
            yield Text("\n".join(progress_lines(words, self.console.width)))


@contextlib.contextmanager
def status_line() -> Iterator[Callable[[str], None]]:
    """Give a function that shows a line in place of the last one; silent without a terminal."""
    if err.is_terminal:
        with err.status("") as line:
            yield lambda text: line.update(Text(visible(text)))
    else:
        yield lambda _: None


class _PlainProgress:
    def __init__(self, what: str, unit: str) -> None:
        self._what = what
        self._unit = unit
        self._began: tuple[float, float] | None = None
        self._next_s = 0.0
        self._ended = False
        self._waits_for = ""

    def __call__(self, done: float, total: float, note: str = "") -> None:
        if not total:
            if note != self._waits_for:
                self._waits_for = note
                err.print(f"{self._what}: {note}")
            return
        now_s = time.monotonic()
        if self._began is None:
            self._began = now_s, done
        began_s, before = self._began
        ends = done >= total and not self._ended
        if now_s >= self._next_s or ends:
            self._next_s = now_s + PLAIN_PERIOD_S
            self._ended = self._ended or ends
            parts = [f"{self._what}: {done:g} of {total:g} {self._unit}".rstrip(), note]
            if before < done < total:
                left_s = round((total - done) * (now_s - began_s) / (done - before))
                parts.append(f"about {left_s // 60}:{left_s % 60:02d} min left")
            err.print(", ".join(filter(None, parts)))
