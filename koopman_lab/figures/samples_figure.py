"""Samples of a session and its smoothed velocities (paper, section 5.2, figure of samples)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from koopman_lab.data.processing import body_velocities, margin, moving_average
from koopman_lab.data.recording import Recording
from koopman_lab.data.segments import Segment
from koopman_lab.errors import DataError
from koopman_lab.figures.canvas import new_figure, save
from koopman_lab.files import write_csv
from koopman_lab.robots.robot_type import RobotType
from koopman_lab.units import US_PER_S

Array = NDArray[np.float64]
WINDOWS = (10, 30, 40, 50, 100)
"""The windows of the paper's figure."""
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")
"""Colours of u_0, u_1, u_2 and so on, in turn."""


@dataclass(frozen=True, eq=False)
class ShownInput:
    """What the figure shows of one basis input.

    Attributes
    ----------
    basis_index, u
        Index and value of the input, in the units of the robot's inputs.
    paths
        By run, positions (k, 2) in m, a sampling time apart.
    shown_run
        Number of the run whose velocities are shown: that of the longest segment.
    velocities
        By window: rows of time since the segment began (s), v (m/s), omega (rad/s), (k, 3).
    """

    basis_index: int
    u: tuple[float, ...]
    paths: list[tuple[int, Array]]
    shown_run: int
    velocities: dict[int, Array]


def shown_inputs(recorded: Recording, windows: Sequence[int] = WINDOWS) -> list[ShownInput]:
    """Return what the figure shows, a basis input each.

    Parameters
    ----------
    recorded
        A calibration session.
    windows
        Lengths of the moving average in frames.

    Raises
    ------
    DataError
        If a basis input has no segment long enough for the widest window.
    """
    frames = recorded.config.mocap.rate_hz * recorded.settings.dt_s
    every = max(1, round(frames))
    shown_by_input = []
    for index, u in recorded.config.sampler.indexed_inputs.items():
        segments = recorded.segments_of(index)
        shown = max(segments, key=lambda s: len(s.poses), default=None)
        longest = 0 if shown is None else len(shown.poses)
        needed = 3 + 2 * margin(max(windows))
        if shown is None or longest < needed:
            raise DataError(
                f"{recorded.path}: the longest segment of basis input {index} has {longest} "
                f"frames, a window of {max(windows)} needs {needed}; leave out the widest with "
                "--windows, or record more segments with `klab calibrate --segments N`"
            )
        paths = [(s.run.number, s.poses[::every, :2]) for s in segments]
        velocities = {window: smoothed(shown, window) for window in windows}
        shown_by_input.append(ShownInput(index, u, paths, shown.run.number, velocities))
    return shown_by_input


def smoothed(segment: Segment, window: int) -> Array:
    """Return rows of time since the segment began (s), v (m/s), omega (rad/s), (k, 3)."""
    poses = segment.poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    velocities = moving_average(body_velocities(segment.utime_us, poses), window)
    first = 1 + margin(window)
    times = segment.utime_us[first : first + len(velocities)] - segment.utime_us[0]
    return np.column_stack([times / US_PER_S, velocities[:, 0], velocities[:, 2]])


def draw_samples(stem: Path, shown: Sequence[ShownInput], robot: RobotType) -> None:
    """Write ``stem.pdf``, ``stem.png``, and the numbers as two CSV files.

    ``stem-positions.csv`` holds run, x1, x2 by basis input, ``stem-velocities.csv`` the velocities
    by basis input and window.

    Parameters
    ----------
    stem
        Path without ending.
    shown
        From :func:`shown_inputs`; a row of the figure each.
    robot
        The robot whose inputs these are.
    """
    figure = new_figure(width=11.0, height=2.7 * len(shown))
    rows = figure.subplots(len(shown), 3, squeeze=False)
    for (plane, v, omega), part in zip(rows, shown, strict=True):
        for _, path in part.paths:
            plane.plot(
                path[:, 0],
                path[:, 1],
                color=COLOURS[part.basis_index % len(COLOURS)],
                linewidth=0.6,
            )
        u = ", ".join(
            f"{value:g} {quantity.unit}"
            for value, quantity in zip(part.u, robot.inputs, strict=True)
        )
        plane.set(xlabel="$x_1$ (m)", ylabel="$x_2$ (m)", title=f"$u_{part.basis_index}$ = ({u})")
        plane.set_aspect("equal", adjustable="datalim")
        _draw_velocities(v, part.velocities, 1)
        v.set(ylabel="v (m/s)", title=f"run {part.shown_run}")
        _draw_velocities(omega, part.velocities, 2)
        omega.set(ylabel=r"$\omega$ (rad/s)", title=f"run {part.shown_run}")
        plane.grid(visible=True)
    handles, labels = rows[0, 1].get_legend_handles_labels()
    figure.legend(
        handles, labels, title="window (frames)", loc="outside upper right", ncols=len(labels)
    )
    save(figure, stem)
    positions = [
        (part.basis_index, run, *point)
        for part in shown
        for run, path in part.paths
        for point in path.tolist()
    ]
    write_csv(_csv_path(stem, "positions"), ("basis_index", "run", "x1_m", "x2_m"), positions)
    velocities = [
        (part.basis_index, part.shown_run, window, *row)
        for part in shown
        for window, values in part.velocities.items()
        for row in values.tolist()
    ]
    columns = ("basis_index", "run", "window", "time_s", "v_m_per_s", "omega_rad_per_s")
    write_csv(_csv_path(stem, "velocities"), columns, velocities)


def _draw_velocities(axes: Axes, velocities: Mapping[int, Array], column: int) -> None:
    # The widest window last: it is the smoothest, and lies over the others.
    for window, rows in sorted(velocities.items()):
        axes.plot(rows[:, 0], rows[:, column], linewidth=0.8, label=str(window))
    axes.set(xlabel="time (s)")
    axes.grid(visible=True)


def _csv_path(stem: Path, what: str) -> Path:
    return stem.with_name(f"{stem.with_suffix('').name}-{what}.csv")
