"""The README's ten minutes, and its Python, in real time and with a page in a real browser."""

import json
import shlex

import pytest
from guide_pages.lines_run import is_alone
from guide_pages.newcomer import GOAL, Newcomer
from guide_pages.shown_output import first_difference
from guide_pages.terminals import by_the_shell

from offboard.commands.view import free_port


def test_a_newcomer_gets_what_the_readme_shows(guides):
    def types(line):
        words = shlex.split(line, comments=True)
        return guides.told(words) if is_alone(words) else by_the_shell(line, guides.checkout)

    newcomer = Newcomer(
        guides.checkout,
        types,
        page_options=("--port", str(free_port())),
        park_options=("--set", "controller.parked_hold_s=1"),
    )
    reached = [what for what, _ in newcomer.reads()]
    assert len(reached) > 5
    summary = json.loads((guides.checkout / "runs/first-park/summary.json").read_text())
    assert summary["goal"][:2] == pytest.approx([GOAL["x1 (m)"], GOAL["x2 (m)"]])


@pytest.mark.parametrize(
    ("shown", "printed", "differs"),
    [
        ("a 1.0 b\n", "x\na 1.01  b\n", None),
        ("a 1.0 b\n", "a 1.2 b\n", "a 1.0 b"),
        ("a ... b\n", "a 7 apples b\n", None),
        ("a\nb\n", "b\na\n", "b"),
        ("12 of 12\n", "12 of 13\n", None),
        ("120 of 120\n", "120 of 130\n", "120 of 120"),
        ("words\n", "other words\n", "words"),
    ],
)
def test_what_is_shown_is_compared_line_by_line(shown, printed, differs):
    assert first_difference(shown, printed) == differs
