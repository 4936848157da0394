"""Progress fits terminals of any width, and all that it says can be read there."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from offboard.terminal.progress_lines import Progress, progress_lines

WAITING = Progress(
    "calibrating",
    note="waits for R1_MOCAP_POSE and R1_ONBOARD_STATUS; are the cameras and the onboard loop "
    "running?",
)
UNDER_WAY = Progress("calibrating", 12, 120, "segments", "8400 samples; waits: R1_ESTOP", 1270.0)


def words(lines):
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize("width", [40, 80])
@pytest.mark.parametrize("progress", [WAITING, UNDER_WAY], ids=["waiting", "under way"])
def test_all_is_said_at_40_and_80_columns(progress, width):
    lines = progress_lines(progress, width)
    assert max(map(len, lines)) <= width
    assert progress.note in words(lines)
    assert progress.what in words(lines)
    if progress.total:
        assert "12/120 segments" in words(lines)
        assert "0:21:10 left" in words(lines)


def test_a_bar_fills_what_is_left_of_a_line_and_shows_the_share():
    (line,) = progress_lines(Progress("parking", 30, 120, "s", "", 90.0), 80)
    assert line == f"parking {'━' * 10}{'─' * 30} 30/120 s 0:01:30 left"
    (line,) = progress_lines(Progress("parking", 30, 120, "s", "", 90.0), 40)
    assert len(line) == 40
    assert line.startswith("parking ━━")


short_words = st.lists(st.text("abcdefg", min_size=1, max_size=12), max_size=12).map(" ".join)


@given(
    what=st.text("abc", min_size=1, max_size=12),
    note=short_words,
    done=st.integers(0, 5000),
    total=st.integers(0, 5000),
    left_s=st.none() | st.floats(0.0, 1e6),
    width=st.integers(24, 200),
)
def test_no_line_is_wider_than_the_terminal_and_no_word_is_lost(
    what, note, done, total, left_s, width
):
    lines = progress_lines(Progress(what, done, total, "s", note, left_s), width)
    assert max(map(len, lines)) <= width
    said = words(lines).split()
    for word in (what, *note.split(), *([f"{done}/{total}"] if total else [])):
        assert word in said
