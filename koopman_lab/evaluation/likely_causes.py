"""What may be wrong where motion contradicts the nominal equations, in words and in order to check.

A wrong axis, a mirrored frame, a reversed wheel or a wrong unit each leave a mark of their own on
the factors between displacements (and turns) that were measured and those that were called for;
:mod:`koopman_lab.geometry.displacement_fit` says which.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from typing import NamedTuple

from koopman_lab.evaluation.nominal_motion import NominalMotion
from koopman_lab.geometry.displacement_fit import DisplacementFit
from koopman_lab.robots.robot_type import RobotType

SAME = 1.25
"""Factors so close to each other count as the same."""
SMALLEST_CLARITY = 0.3
"""What follows less neither way follows nothing."""
MM_PER_M = 1e3
DEG_PER_RAD = math.degrees(1.0)

MIRRORED_FRAME = (
    "the frame is mirrored (its x2 and its heading count the other way round), or left and right "
    "wheel are exchanged"
)
BACKWARDS = "the tracked body's axis points backwards (its heading is 180 deg off)"
BACK_IN_TIME = (
    "X and Y are exchanged, or the frame is mirrored and the tracked body's axis points backwards"
)
QUARTER_TURN = "positions and heading are turned by 90 deg against each other"
MIRRORED_AXIS = "one axis counts the other way round (x2, or x1)"
MIRRORED_HEADING = "the heading counts the other way round (clockwise)"
STANDS_STILL = "the tracking shows a body that stands, or the robot did not follow its commands"
WRONG_LENGTHS = (
    "robot.wheel_radius_m, robot.track_width_m or motor_loop.encoder_counts_per_rev are not the "
    "robot's, or it did not follow its commands"
)
EXCHANGED_AXES = "x1 and x2 are exchanged"


class Registration(NamedTuple):
    """How measured motion lies to the one called for.

    Attributes
    ----------
    angle_rad
        By which displacements are turned, of their mirror images if ``mirrored``.
    mirrored
        Whether it is rather mirror images that displacements follow.
    clarity
        How much displacements follow either; 1 where they do.
    ahead
        Factor of motion ahead, not negative.
    turn
        Factor of turns, None where nothing calls for any.
    """

    angle_rad: float
    mirrored: bool
    clarity: float
    ahead: float
    turn: float | None


def of_fit(fit: DisplacementFit, turn: float | None) -> Registration:
    """Return what displacements and turns say, as multiples of those called for."""
    mirrored = abs(fit.mirrored) > abs(fit.kept)
    factor = fit.mirrored if mirrored else fit.kept
    return Registration(cmath.phase(factor), mirrored, abs(factor), abs(factor), turn)


def registration(motion: NominalMotion, robot: RobotType) -> Registration:
    """Return what the motion of pairs says of the frame that they were measured in."""
    if motion.heading is None:
        seen = of_fit(motion.displacement, motion.turn)
    else:
        seen = of_fit(motion.heading, motion.turn)
        seen = seen._replace(angle_rad=0.5 * seen.angle_rad)
    # Where the velocity is of the same frame, only what inputs do to it has the robot's own sign.
    by_rate = [motion.rates.get(robot.state_names[place]) for place in robot.speeds_at]
    if by_rate and by_rate[0] is not None:
        backwards = by_rate[0] < 0.0 and not seen.mirrored
        angle = seen.angle_rad + (math.pi if backwards else 0.0)
        seen = seen._replace(ahead=abs(by_rate[0]), angle_rad=angle)
    if by_rate and by_rate[1] is not None:
        seen = seen._replace(turn=by_rate[1])
    return seen


def causes(motion: NominalMotion, robot: RobotType) -> list[str]:
    """Return what is likely to be wrong with the frame, signs or units, the likeliest first."""
    seen = registration(motion, robot)
    if motion.heading is None:
        return frame_causes(seen)
    # A velocity that comes from poses is of the right times: the way in a step tells.
    steps = abs(motion.displacement.kept), abs(motion.turn or 0.0)
    return [*_of_times(*steps)] or frame_causes(seen)


def frame_causes(seen: Registration) -> list[str]:
    """Return what is likely to be wrong by how motion lies to the one called for."""
    if seen.clarity < SMALLEST_CLARITY and seen.ahead < SMALLEST_CLARITY:
        return [STANDS_STILL]
    wrong = [*_of_times(seen.ahead, abs(seen.turn or 0.0))] or [*_of_axes(seen), *_of_units(seen)]
    sizes = (seen.ahead, abs(seen.turn or 1.0))
    if wrong or all(_same(size, 1.0) for size in sizes):
        return wrong
    return [WRONG_LENGTHS]


def _of_axes(seen: Registration) -> Iterator[str]:
    quarters = round(seen.angle_rad / (0.5 * math.pi)) % 4
    clockwise = seen.turn is not None and seen.turn < 0.0
    if seen.mirrored:
        if quarters % 2:
            yield EXCHANGED_AXES
        else:
            yield MIRRORED_HEADING if clockwise else MIRRORED_AXIS
    elif quarters % 2:
        yield QUARTER_TURN
    elif quarters == 2:
        yield BACK_IN_TIME if clockwise else BACKWARDS
    elif clockwise:
        yield MIRRORED_FRAME
    elif abs(seen.angle_rad) > math.radians(5.0):
        yield f"the heading is {math.degrees(-seen.angle_rad):.0f} deg off"


def _of_units(seen: Registration) -> Iterator[str]:
    if _same(seen.ahead, MM_PER_M):
        yield "positions are in mm, and not in m"
    elif _same(seen.ahead, 1.0 / MM_PER_M):
        yield "positions are in km, and not in m"
    if _same(abs(seen.turn or 0.0), DEG_PER_RAD):
        yield "headings are in degrees, and not in rad"


def _of_times(moved: float, turned: float) -> Iterator[str]:
    if moved and turned and not _same(moved, 1.0) and _same(moved, turned):
        yield f"the sampling time is {moved:.2g} times the one stated, or times have another unit"


def _same(one: float, other: float) -> bool:
    return one > 0.0 and abs(math.log(one / other)) < math.log(SAME)
