"""A session at a glance: where the robot went, how fast, and what it was told."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from koopman_lab.bus.channels import (
    MOCAP_POSE,
    ONBOARD_STATUS,
    WHEEL_STATE,
    command_channel,
)
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.message_arrays import StructuredArray
from koopman_lab.errors import LogError
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv
from koopman_lab.robots.table import ROBOTS
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
JUMP_M = 0.2
"""No robot drives so far between two frames: it was placed anew, or not seen for a while."""
STANDING_M = 0.02
"""What has a smaller extent is a robot that waits, with noise."""
TABLES = ("path", "measured", "wanted", "commands")
"""End the names of the files of numbers, in the order of the tables of a plot."""


class Shown(NamedTuple):
    """One table of numbers.

    ``columns`` names those of ``rows`` (N, len(columns)); the first is the time since the first
    camera frame (s). ``labels`` are what to write at the axes of the others.
    """

    columns: tuple[str, ...]
    rows: Array
    labels: tuple[str, ...] = ()


class SessionPlot(NamedTuple):
    """What is drawn; tables without rows are of channels that the log does not hold.

    ``commands`` are the inputs of a robot, (N, 1 + m).
    """

    path: Shown
    measured: Shown
    set_points: Shown
    commands: Shown


def session_plot(log: SessionLog) -> SessionPlot:
    """Return what a log says of path, speeds and commands.

    Raises
    ------
    LogError
        If the log cannot be used, or holds no camera frame in which the robot was seen.
    """
    frames = log.array(MOCAP_POSE)
    frames = frames[frames["tracking_valid"]]
    if not len(frames):
        raise LogError(
            f"{log.path}: {MOCAP_POSE.name(log.robot_name)} holds no frame in which the robot was "
            "seen; there is no path to draw"
        )
    begin_us = int(frames["utime"].min())

    def table(messages: StructuredArray, *fields: str) -> Shown:
        times_us = messages["utime"].astype(np.int64)
        # Before the board knows the desk's time its messages may seem later than those after them.
        in_order = times_us <= np.minimum.accumulate(times_us[::-1])[::-1]
        messages, times_us = messages[in_order], times_us[in_order]
        time_s = (times_us - begin_us) / US_PER_S
        columns = [time_s, *(messages[field].astype(np.float64) for field in fields)]
        return Shown(("time_s", *fields), np.column_stack(columns))

    speeds = "v_m_per_s", "omega_rad_per_s"
    set_points = "v_setpoint_m_per_s", "omega_setpoint_rad_per_s"
    commanded = [robot for robot in ROBOTS if robot.command is not None]
    commands_by_robot = [log.array(command_channel(robot), needed=False) for robot in commanded]
    busiest = max(range(len(commands_by_robot)), key=lambda k: len(commands_by_robot[k]))
    commands = table(commands_by_robot[busiest], *commanded[busiest].commanded().fields)
    labels = tuple(u.label for u in commanded[busiest].inputs)
    return SessionPlot(
        table(frames, "x1_m", "x2_m", "theta_rad"),
        table(log.array(WHEEL_STATE, needed=False), *speeds),
        table(log.array(ONBOARD_STATUS, needed=False), *set_points),
        commands._replace(labels=labels),
    )


def pieces(path: Array) -> list[Array]:
    """Return what was driven in one go, without the waiting before and between.

    Parameters
    ----------
    path
        Positions (N, 2) in m, N at least 1.
    """
    steps = np.hypot(*np.diff(path, axis=0).T)
    parts = np.split(path, 1 + np.flatnonzero(steps > JUMP_M))
    driven = [part for part in parts if np.ptp(part, axis=0).max() > STANDING_M]
    return driven or parts[-1:]


def draw_session(stem: Path, shown: SessionPlot) -> None:
    """Write ``stem.pdf``, ``stem.png`` and the numbers as CSV beside them.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    lines = max(2, len(shown.commands.labels))
    figure = new_figure(width=11.0, height=3.0 * lines)
    grid = figure.add_gridspec(lines, 3)
    plane = figure.add_subplot(grid[:, 0])
    drives = pieces(shown.path.rows[:, 1:3])
    for drive in drives:
        plane.plot(*drive.T, color="tab:blue", linewidth=1.0)
    begins = np.array([drive[0] for drive in drives])
    plane.plot(*begins.T, "o", color="tab:green", label="begin")
    plane.plot(*drives[-1][-1], "s", color="tab:red", label="end")
    plane.set(xlabel="$x_1$ (m)", ylabel="$x_2$ (m)", title="path")
    plane.set_aspect("equal", adjustable="datalim")
    plane.legend()
    for k, name in ((1, "v (m/s)"), (2, "ω (rad/s)")):
        axes = figure.add_subplot(grid[k - 1, 1])
        axes.plot(shown.measured.rows[:, 0], shown.measured.rows[:, k], color="tab:blue")
        axes.plot(
            shown.set_points.rows[:, 0], shown.set_points.rows[:, k], "--", color="tab:orange"
        )
        axes.set(xlabel="time (s)", ylabel=name, title="measured, set-point dashed")
    for k, label in enumerate(shown.commands.labels, start=1):
        inputs_axes = figure.add_subplot(grid[k - 1, 2])
        inputs_axes.step(
            shown.commands.rows[:, 0], shown.commands.rows[:, k], where="post", color="tab:orange"
        )
        inputs_axes.set(xlabel="time (s)", ylabel=label, title="commanded")
    for axes in figure.axes:
        axes.grid(visible=True)
    save(figure, stem)
    for name, table in zip(TABLES, shown, strict=True):
        write_csv(stem.with_name(f"{stem.name}-{name}.csv"), table.columns, table.rows.tolist())
