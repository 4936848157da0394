"""Progress as a person sees it: a bar on a terminal, plain lines elsewhere."""

import os
import pty
import re
import subprocess
import sys

import pytest
from klab import environment

from offboard.terminal import output as terminal

WORK = """
from offboard.terminal.output import progress
with progress("calibrating", "segments") as report:
    for done in (4, 5, 6, 7, 8):
        report(done, 8, f"{done * 700} samples")
"""


def run_on_terminal(code):
    """Run Python with a terminal as its standard error; return what appeared on it."""
    ours, theirs = pty.openpty()
    try:
        wide = environment(TERM="xterm", COLUMNS="100")
        subprocess.run([sys.executable, "-c", code], stderr=theirs, env=wide, check=True)
        # Everything at once: a few lines are less than a terminal holds.
        return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", os.read(ours, 1 << 16).decode())
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_bar_shows_segments_samples_and_the_time_left():
    lines = run_on_terminal(WORK).replace("\r", "\n").split("\n")
    shown = next(line for line in reversed(lines) if "calibrating" in line)
    assert re.search(r"8/8 segments 5600 samples 0:00:00 left", shown)


def test_plain_lines_show_the_same_and_judge_by_what_this_session_did(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 20.0, 400.0])
    monkeypatch.setattr(terminal.time, "monotonic", lambda: next(clock))
    with terminal.progress("calibrating", "segments") as report:
        report(10, 50, "7000 samples")
        report(11, 50, "7100 samples")
        report(12, 50, "7700 samples")
        report(50, 50, "35000 samples")
    assert capsys.readouterr().err.splitlines() == [
        "calibrating: 10 of 50 segments, 7000 samples",
        # Two in 20 s, so 38 more take 380 s.
        "calibrating: 12 of 50 segments, 7700 samples, about 6:20 min left",
        "calibrating: 50 of 50 segments, 35000 samples",
    ]


@pytest.mark.parametrize(("unit", "said"), [("s", "parking: 1 of 2 s"), ("", "parking: 1 of 2")])
def test_words_that_are_not_there_leave_no_gap(capsys, unit, said):
    with terminal.progress("parking", unit) as report:
        report(1, 2)
    assert capsys.readouterr().err.strip() == said
