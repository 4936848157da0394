"""A kind of robot that the product does not know, described here and nowhere else.

It stands on three wheels that roll in any direction, so that its inputs are all three velocities of
its body: 3 states and 3 inputs.
"""

import numpy as np

from koopman_lab.robots.robot_type import Quantity, RobotType

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


def components(x, u, dt_s, m):
    """Integrate the body's velocities, constant over the interval, in the inertial frame."""
    (x1, x2, theta), (ahead, aside, omega) = x, u
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        angle = theta + omega * dt_s * float(0.5 * (1.0 + node))
        share = dt_s * float(0.5 * weight)
        x1 = x1 + share * (ahead * m.cos(angle) - aside * m.sin(angle))
        x2 = x2 + share * (ahead * m.sin(angle) + aside * m.cos(angle))
    return [x1, x2, theta + omega * dt_s]


DEFAULTS = """
placement: {position_m: 0.0, angle_rad: 0.0}
sampler:
  segments_per_basis: 3
  basis_inputs: [[0.2, 0.0, 0.0], [0.0, 0.2, 0.3], [0.1, -0.1, -0.6]]
  admissible_set:
    {x1_m: [-1, 1], x2_m: [-1, 1], theta_rad: [-4, 4], v_m_per_s: [-1, 1], omega_rad_per_s: [-1, 1]}
processing: {discard_start_s: 0.1}
model: {dictionary: "1, x1, x2, cos(theta), sin(theta)"}
controller:
  horizon: 10
  u_max: [0.4, 0.4, 1.5]
  weights:
    me: {q: [1.0, 1.0, 0.1], r: [0.5, 0.5, 0.05]}
    ce: {q: [1.0, 1.0, 0.1], r: [0.5, 0.5, 0.05]}
    ds: {q: [1.0], r: [0.5, 0.5, 0.05]}
"""


class File:
    """What is beside the description of a robot of another package."""

    name = "omnidirectional.yaml"

    @staticmethod
    def read_text(encoding=None):
        """Return the defaults."""
        assert encoding in (None, "utf-8")
        return DEFAULTS


OMNIDIRECTIONAL = RobotType(
    name="omnidirectional",
    title="omnidirectional robot",
    states=(Quantity("x1", "m"), Quantity("x2", "m"), Quantity("theta", "rad")),
    inputs=(Quantity("ahead", "m/s"), Quantity("aside", "m/s"), Quantity("omega", "rad/s")),
    components=components,
    drifts=False,
    sideways=(),
    speeds_at=(),
    braking=lambda _x, u_max, _dt_s, steps: np.zeros((steps, len(u_max))),
    effort=np.ones,
    defaults=File(),
)
KIND = OMNIDIRECTIONAL.name
EXPRESSIONS = ("1", "x1", "x2", "cos(theta)", "sin(theta)")
BASIS = {1: (0.2, 0.0, 0.0), 2: (0.0, 0.2, 0.3), 3: (0.1, -0.1, -0.6)}
