"""The presets: what is simulated, and how far from the paper's ideal."""

from __future__ import annotations

from enum import Enum


class Preset(str, Enum):
    """Choices of ``--preset``.

    What one changes is in ``defaults/PRESET.yaml``, and for a kind of robot alone in the section
    ``presets`` of that kind's file; ``lab`` is what the files say without a preset.
    """

    real = "real"
    """Nothing is simulated; cautious on a robot that nobody has driven yet."""
    lab = "lab"
    """A robot of 1 kg on a good Wi-Fi, its motors, wheels and markers a little off."""
    harsh = "harsh"
    """Three times as far off."""
    ideal = "ideal"
    """The nominal equations of the paper."""
