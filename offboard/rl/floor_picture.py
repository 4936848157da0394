"""A picture of the floor, the robot's path on it, and the goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray

from koopman_lab.config.sampler import Area
from koopman_lab.figures.canvas import new_figure
from koopman_lab.geometry.planar import Pose

SIDE_INCHES = 4.0
ARROW_M = 0.2
"""Length of the arrows that stand for poses."""


def floor_picture(floor: Area, goal: Pose, path: Sequence[Pose]) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) of red, green and blue, 0 to 255.

    Parameters
    ----------
    floor
        Its edges are those of the picture.
    goal
        In the inertial frame.
    path
        Poses in the inertial frame, at least one; the last one is the robot's.
    """
    figure = new_figure(SIDE_INCHES, SIDE_INCHES)
    axes = figure.subplots()
    positions = np.array(path)
    axes.plot(positions[:, 0], positions[:, 1], color="tab:blue")
    for pose, colour in ((goal, "tab:red"), (path[-1], "tab:blue")):
        axes.arrow(
            pose.x1,
            pose.x2,
            ARROW_M * np.cos(pose.theta),
            ARROW_M * np.sin(pose.theta),
            width=0.02,
            length_includes_head=True,
            color=colour,
        )
    axes.set(xlim=floor.x1_m, ylim=floor.x2_m, xlabel="$x_1$ (m)", ylabel="$x_2$ (m)")
    axes.set_aspect("equal")
    axes.grid(visible=True)
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)  # by new_figure
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]
