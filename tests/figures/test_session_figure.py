"""A log at a glance."""

import csv
from pathlib import Path

import numpy as np

from koopman_lab.data.decode import SessionLog
from koopman_lab.figures.session_figure import draw_session, pieces, session_plot

REFERENCE = Path(__file__).parents[1] / "data" / "reference"


def test_path_speeds_and_commands_are_drawn_and_their_numbers_written(tmp_path):
    shown = session_plot(SessionLog(REFERENCE / "park.lcm"))
    draw_session(tmp_path / "plot", shown)
    assert (tmp_path / "plot.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    for part, table in zip(("path", "measured", "wanted", "commands"), shown, strict=True):
        with (tmp_path / f"plot-{part}.csv").open() as file:
            columns, *rows = csv.reader(file)
        assert tuple(columns) == table.columns
        assert np.array_equal(np.array(rows, float), table.rows)
        assert len(table.rows) > 20
    # The path is one that a robot can drive: 0.6 m/s are 5 mm a frame.
    steps = np.hypot(*np.diff(shown.path.rows[:, 1:3], axis=0).T)
    assert 0.0 < steps.max() < 0.02


def line(*ends):
    """Return a path from the first to the last of these, in steps of a hundredth."""
    return np.linspace(*np.array(ends, float), 100)


def test_no_line_is_drawn_to_where_the_robot_was_placed():
    waiting, there, again = line((0, 0), (0.01, 0)), line((1, 1), (1.5, 1)), line((0, 0.5), (0, 1))
    assert [len(part) for part in pieces(np.concatenate([waiting, there, again]))] == [100, 100]
    first, second = pieces(np.concatenate([waiting, there, again]))
    assert np.array_equal(first, there)
    assert np.array_equal(second, again)
    (still,) = pieces(waiting)
    assert np.array_equal(still, waiting)
    assert len(pieces(waiting[:1])) == 1


def test_times_before_the_board_knows_the_time_are_left_out():
    shown = session_plot(SessionLog(REFERENCE / "park.lcm"))
    for table in shown:
        assert np.all(np.diff(table.rows[:, 0]) >= 0.0)
