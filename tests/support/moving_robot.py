"""A robot that rolls exactly, and what cameras and wheels that may lie say of it."""

import math

import numpy as np

from koopman_lab.geometry.planar import Pose, Velocity, compose, move_along_arc, wrap_angle
from offboard.desk.measurements import Frame, WheelSpeeds

STEP_US = 50_000
STANDS = 8
"""So many steps a robot stands before it drives: the guard wants to see it at one place."""


def honest(pose):
    return pose


LIES = {
    "heading backwards": lambda p: Pose(p.x1, p.x2, wrap_angle(p.theta + math.pi)),
    "x2 mirrored": lambda p: Pose(p.x1, -p.x2, p.theta),
    "frame mirrored": lambda p: Pose(p.x1, -p.x2, -p.theta),
    "axes exchanged": lambda p: Pose(p.x2, p.x1, p.theta),
    "frame turned": lambda p: Pose(-p.x2, p.x1, p.theta),
    "heading turned": lambda p: Pose(p.x1, p.x2, wrap_angle(p.theta + math.pi / 2)),
    "heading negated": lambda p: Pose(p.x1, p.x2, -p.theta),
    "in feet": lambda p: Pose(3.28 * p.x1, 3.28 * p.x2, p.theta),
    "another body that stands": lambda _: Pose(1.0, 1.0, 0.3),
}
"""Each makes of the true pose what wrong cameras report; all wrong from the beginning."""
WHEEL_LIES = {
    "left and right exchanged": lambda left, right: (right, left),
    "both reversed": lambda left, right: (-left, -right),
    "exchanged and reversed": lambda left, right: (-right, -left),
    "counts a quarter": lambda left, right: (0.25 * left, 0.25 * right),
    "do not count": lambda *_: (0.0, 0.0),
}
"""Each makes of the true speeds what wrong wheels report."""


def noisy(rng, position_m=0.0006, angle_rad=0.0026):
    """Return cameras with the noise of preset `harsh`."""

    def see(pose):
        e = rng.standard_normal(3) * (position_m, position_m, angle_rad)
        return Pose(pose.x1 + e[0], pose.x2 + e[1], wrap_angle(pose.theta + e[2]))

    return see


START = Pose(0.2, 0.1, 0.5)


def drive(speeds, see=honest, roll=lambda left, right: (left, right), start=START):
    """Yield time (us), frames, wheels, true velocity and pose, a step each of the ``speeds``.

    Before them it stands for a while. Body velocities change at once; wheels report the mean
    of the last 50 ms.
    """
    pose, now_us, half = start, 1_000_000, 0.1
    for v, omega in [(0.0, 0.0)] * STANDS + list(speeds):
        for _ in range(12):
            pose = compose(pose, move_along_arc(Pose(0, 0, 0), v / 240, omega / 240))
        now_us += STEP_US
        left, right = roll(v - half * omega, v + half * omega)
        wheels = WheelSpeeds(
            now_us - STEP_US // 2,
            Velocity(0.5 * (left + right), 0.5 * (right - left) / half),
        )
        yield now_us, [Frame(now_us - 4_000, see(pose), True)], wheels, Velocity(v, omega), pose


def random_speeds(rng, steps, v_max=0.5, omega_max=2.0, a=0.5, alpha=5.0):
    """Return body velocities that wander within limits of speed and acceleration."""
    v, omega, speeds = 0.0, 0.0, []
    target = (0.0, 0.0)
    for k in range(steps):
        if k % 20 == 0:
            target = rng.uniform(-1, 1, 2) * (v_max, omega_max)
        v += float(np.clip(target[0] - v, -a * 0.05, a * 0.05))
        omega += float(np.clip(target[1] - omega, -alpha * 0.05, alpha * 0.05))
        speeds.append((v, omega))
    return speeds
