"""How motors and encoders hang on the board: exchanged, reversed, or as they should.

Each wiring maps (left, right) to (left, right) by one of the eight signed permutations of two
things. A part is named by the wheel at which it sits: with both exchanged, the left motor is the
one at the left wheel, which the board drives by its right output.
"""

from __future__ import annotations

from typing import NamedTuple

from koopman_lab.emulation.faults import Effects


class Wiring(NamedTuple):
    """The wiring of both motors, or of both encoders.

    Attributes
    ----------
    left, right
        What happens to the signal of the part at this wheel: 1 nothing, -1 its sign changes, 0 it
        is lost.
    exchanged
        Whether each part hangs where the other one should.
    """

    left: int = 1
    right: int = 1
    exchanged: bool = False

    def to_parts(self, left: float, right: float) -> tuple[float, float]:
        """Return what the parts get of what the board sends."""
        if self.exchanged:
            left, right = right, left
        return self.left * left, self.right * right

    def to_board(self, left: int, right: int) -> tuple[int, int]:
        """Return what the board gets of what the parts send."""
        left, right = self.left * left, self.right * right
        return (right, left) if self.exchanged else (left, right)


AS_INTENDED = Wiring()


def motor_wiring(effects: Effects) -> Wiring:
    """Return how the motors are wired."""
    left, right = (-1 if reverse else 1 for reverse in effects.motor_reversed)
    return Wiring(left, right, effects.includes("motors_exchanged"))


def encoder_wiring(effects: Effects) -> Wiring:
    """Return how the encoders are wired; one that is stuck sends nothing."""
    left, right = (
        0 if stuck else -1 if reverse else 1
        for stuck, reverse in zip(effects.encoder_stuck, effects.encoder_reversed, strict=True)
    )
    return Wiring(left, right, effects.includes("encoders_exchanged"))
