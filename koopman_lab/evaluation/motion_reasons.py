"""From figures of motion to reasons of a verdict: how far from the nominal equations is too far."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from koopman_lab.evaluation.likely_causes import registration
from koopman_lab.evaluation.nominal_motion import InputMotion, NominalMotion
from koopman_lab.evaluation.plausibility import LEVELS, Level, Reason
from koopman_lab.robots.robot_type import RobotType

GOOD_FACTOR = 1.2
"""Assumption: a robot whose wheels are 3 % and whose track width is 5 % off, as in preset `harsh`,
turns by 0.89 to 1.07 of what is called for."""
LARGEST_FACTOR = 3.0
"""Assumption: no robot that obeys is so far off; 1 / 3 at the other end."""
GOOD_ANGLE_RAD = 0.15
"""Assumption: five times the angle by which the cameras' frame is off in preset `harsh`."""
LARGEST_ANGLE_RAD = math.pi / 4
GOOD_UNCALLED, LARGEST_UNCALLED = 0.2, 0.7
"""Assumptions: turns or changes that nothing calls for, as shares of the strongest effect of any
input; 0.09 at most in preset `harsh`."""
SURE_ERRORS = 4.0
"""Standard errors that noise does not lead a share astray: one of 16 000 is led farther."""
GOOD_UNEXPLAINED = 0.5
"""Assumption: the cameras' noise alone makes 0.12 in preset `harsh`."""


def data_reasons(motion: NominalMotion, robot: RobotType, likely: Sequence[str]) -> list[Reason]:
    """Return what is wrong with the motion of measured pairs.

    Parameters
    ----------
    motion
        All of the pairs.
    robot
        Whose pairs they are.
    likely
        Causes to name where the data contradict the basis inputs, the likeliest first.
    """
    level = worst([*map(_input_level, motion.inputs.values()), frame_level(motion, robot)])
    reasons = []
    if level != "good":
        offending = [
            input_text(name, inputs)
            for name, inputs in motion.inputs.items()
            if _input_level(inputs) != "good"
        ] or [input_text(name, inputs) for name, inputs in motion.inputs.items()]
        text = f"the data contradict the basis inputs: {'; '.join(offending)}"
        reasons.append(Reason(level, text + because(likely)))
    if motion.unexplained > GOOD_UNEXPLAINED and level == "good":
        reasons.append(
            Reason(
                "weak",
                f"of each step {100 * motion.unexplained:.0f} % is not explained by the input: the "
                "cameras are noisy for so slow a robot, or poses come late; train with a longer "
                "--dt",
            )
        )
    return reasons


def frame_level(motion: NominalMotion, robot: RobotType) -> Level:
    """Return how well displacements lie along those called for."""
    fit = motion.displacement if motion.heading is None else motion.heading
    if not fit.kept and not fit.mirrored:
        return "good"  # it stood still: its inputs say whether it should have
    seen = registration(motion, robot)
    angle = abs(math.remainder(seen.angle_rad, 2.0 * math.pi))
    if seen.mirrored or angle > LARGEST_ANGLE_RAD:
        return "unusable"
    weak = angle > GOOD_ANGLE_RAD or abs(fit.mirrored) > 0.5 * abs(fit.kept)
    return "weak" if weak else "good"


def factor_level(factor: float | None, smallest: float = 1.0 / LARGEST_FACTOR) -> Level:
    """Return what to think of a factor that should be 1; None says nothing."""
    if factor is None or 1.0 / GOOD_FACTOR <= factor <= GOOD_FACTOR:
        return "good"
    return "weak" if smallest <= factor <= LARGEST_FACTOR else "unusable"


def worst(levels: Sequence[Level]) -> Level:
    """Return the worst of levels, good if there are none."""
    return max(levels, key=LEVELS.index, default="good")


def _input_level(motion: InputMotion) -> Level:
    factors = {"moved": motion.moved, "theta": motion.turned, **motion.rates}
    levels = [factor_level(_surely(motion, name, 1.0, share)) for name, share in factors.items()]
    for name, uncalled in motion.uncalled.items():
        share = abs(_surely(motion, name, 0.0, uncalled) or 0.0)
        levels.append("good" if share < GOOD_UNCALLED else "weak")
        levels.append("good" if share < LARGEST_UNCALLED else "unusable")
    return worst(levels)


def _surely(motion: InputMotion, name: str, called_for: float, share: float | None) -> float | None:
    """Return what of a share noise leaves sure: the nearest to what is called for."""
    if share is None:
        return None
    spread = SURE_ERRORS * motion.errors.get(name, 0.0)
    return min(max(called_for, share - spread), share + spread)


def input_text(name: str, motion: InputMotion, who: str = "the robot") -> str:
    """Return in words what ``who`` did under an input, in shares of what that calls for."""
    return f"under {name} {who} {' and '.join(_shares(motion))} of what is called for"


def _shares(motion: InputMotion) -> Iterator[str]:
    for verb, share in (("moved", motion.moved), ("turned", motion.turned)):
        if share is not None:
            yield f"{verb} {share:.2f}"
    for name, share in motion.rates.items():
        yield f"changed {name} by {share:.2f}"
    for name, share in motion.uncalled.items():
        if abs(share) >= GOOD_UNCALLED:
            yield f"changed {name}, which it leaves alone, by {share:.2f}"
    if motion.moved is not None and motion.aside is not None and abs(motion.aside) > GOOD_UNCALLED:
        yield f"moved sideways {motion.aside:.2f}"


def because(likely: Sequence[str]) -> str:
    """Return the end of a sentence that names likely causes, in the order in which to check."""
    order = ", in this order" if len(likely) > 1 else ""
    return f"; likely{order}: {'; '.join(likely)}" if likely else ""
