"""What all figures share: drawn without a screen, saved as PDF and PNG, whole or not at all."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from koopman_lab.files import replacing

DPI = 150


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure; the size is in inches."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, stem: Path) -> None:
    """Write ``stem.pdf`` and ``stem.png``."""
    for ending in ("pdf", "png"):
        # In memory first: where the disk is full, a back end stumbles over its own cleaning up.
        drawn = io.BytesIO()
        figure.savefig(drawn, format=ending, dpi=DPI)
        with replacing(stem.with_suffix(f".{ending}")) as file:
            file.write(drawn.getbuffer())
