"""Two geared DC motors on one battery, coupled through the body they push."""

from __future__ import annotations

import math

import numpy as np

from koopman_lab.config.schema import LabConfig
from koopman_lab.units import US_PER_S
from onboard.plant.battery import Battery

MOST_TRANSITIONS = 8192

Transition = tuple[tuple[float, float, float], tuple[float, float]]
"""What is left of a deviation from the steady speeds after a step.

First (left, cross, right) for two turning wheels, then (left, right) where the other is held.
"""


class Drivetrain:
    """Wheel speeds (rad/s) of a robot with mass, inertia, friction and a battery.

    With the wheel speeds w, both wheels rolling without longitudinal slip,

        M w' = (k / R) (g d U - k w) - b w - friction + inertia forces,

    where M is the 2x2 mass matrix of body, wheels and rotors in wheel coordinates, k the back-EMF
    of one motor at its wheel (V s/rad, equal to N m/A), U the voltage of the battery under the
    load, d the duty and g the gain of the driver. The inertia forces come from a centre of mass
    ahead of the axle.

    The linear part is solved exactly by matrix exponentials, kept per length of step; voltage and
    inertia forces change linearly over a step (exponential Runge-Kutta method of second order).
    Coulomb friction is constant while a wheel turns; a wheel at rest is held until the torque on
    it exceeds the break-away torque.
    """

    def __init__(self, config: LabConfig) -> None:
        simulated, robot = config.require_simulation().plant, config.robot
        motor, body = simulated.motor, simulated.body
        left_m = robot.wheel_radius_m * body.wheel_radius_factor[0]
        right_m = robot.wheel_radius_m * body.wheel_radius_factor[1]
        track_m = robot.track_width_m * body.track_width_factor
        self.left_rad_per_s = 0.0
        self.right_rad_per_s = 0.0
        self.until_kink_us: int | None = None
        self._battery = Battery(simulated.battery, motor.resistance_ohm)
        self._back_emf = motor.gear_ratio * motor.torque_constant_n_m_per_a
        self._torque_per_v = self._back_emf / motor.resistance_ohm
        self._resistance_ohm = motor.resistance_ohm
        self._damping = self._back_emf * self._torque_per_v + motor.viscous_friction_n_m_s_per_rad
        self._gain_left, self._gain_right = motor.gain
        self._coulomb_left, self._coulomb_right = motor.coulomb_friction_n_m
        self._breakaway = motor.breakaway_friction_n_m
        self._breakaway_left, self._breakaway_right = self._breakaway

        turning = body.wheel_inertia_kg_m2 + motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
        along, about = body.mass_kg / 4.0, body.inertia_kg_m2 / track_m**2
        self._mass_left = turning + left_m**2 * (along + about)
        self._mass_cross = left_m * right_m * (along - about)
        self._mass_right = turning + right_m**2 * (along + about)
        masses = [[self._mass_left, self._mass_cross], [self._mass_cross, self._mass_right]]
        eigen = np.linalg.eigh(np.array(masses))
        self._modes: list[float] = eigen.eigenvalues.tolist()
        self._directions: list[list[float]] = eigen.eigenvectors.tolist()
        self._transitions: dict[int, Transition] = {}
        self._held_us = 0

        # The body turns by right * w_r - left * w_l and drives half the sum of the rim speeds.
        self._rolling = (0.5 * left_m, 0.5 * right_m, left_m / track_m, right_m / track_m)
        self._mass_ahead = body.mass_kg * body.centre_of_mass_ahead_m
        self._share_left = self._share_right = 0.0
        self._base_v, self._droop_left, self._droop_right = self._battery.terminal(0.0, 0.0)

    def battery_v(self) -> float:
        """Return the voltage at the terminals under the present load."""
        return (
            self._base_v
            + self._droop_left * self.left_rad_per_s
            + self._droop_right * self.right_rad_per_s
        )

    @property
    def state_of_charge(self) -> float:
        """Return what was left in the battery, in [0, 1], when the duties were last set."""
        return self._battery.state_of_charge

    def drive(self, left_duty: float, right_duty: float) -> None:
        """Set the duties, each in [-1, 1]; what the last ones took is counted first."""
        self._take_charge()
        self._share_left = left_duty * self._gain_left
        self._share_right = right_duty * self._gain_right
        # The charge changes so slowly that its voltage may stand still until the next duty.
        self._base_v, left, right = self._battery.terminal(self._share_left, self._share_right)
        self._droop_left, self._droop_right = left * self._back_emf, right * self._back_emf

    def halt(self) -> None:
        """Stop both wheels at once, as a hand does that lifts the robot."""
        self.left_rad_per_s = self.right_rad_per_s = 0.0

    def stall(self, left: bool, right: bool) -> None:
        """Lock these rotors at once, and no others: nothing breaks a locked one away."""
        self._breakaway_left = math.inf if left else self._breakaway[0]
        self._breakaway_right = math.inf if right else self._breakaway[1]
        self.left_rad_per_s *= not left
        self.right_rad_per_s *= not right

    def feed(self, battery_v: float | None) -> None:
        """Hold the terminals at a voltage (V) from the next duties on, or leave them alone."""
        self._battery.held_v = battery_v

    def advance(self, step_us: int) -> None:
        """Integrate one step."""
        self._held_us += step_us
        left, right = self.left_rad_per_s, self.right_rad_per_s
        torque_left, torque_right = self._torques(left, right)
        direction_left = 1.0 if left > 0.0 else -1.0 if left < 0.0 else 0.0
        direction_right = 1.0 if right > 0.0 else -1.0 if right < 0.0 else 0.0
        both, alone = self._transitions.get(step_us) or self._transition(step_us)
        keep_left, keep_cross, keep_right = both
        if not (direction_left and direction_right):
            direction_left, direction_right = self._released(
                torque_left, torque_right, direction_left, direction_right
            )
            if not direction_left and not direction_right:
                return
            if not (direction_left and direction_right):
                left_alone, right_alone = alone
                keep_left = left_alone if direction_left else 1.0
                keep_right = right_alone if direction_right else 1.0
                keep_cross = 0.0
        friction_left = direction_left * self._coulomb_left
        friction_right = direction_right * self._coulomb_right
        # Deviations from the speeds at which these torques would balance. A held wheel keeps all
        # of its own, so that it stays at rest whatever the torque.
        damping = self._damping
        off_left = left - (torque_left - friction_left) / damping
        off_right = right - (torque_right - friction_right) / damping
        after_left = left - off_left + keep_left * off_left + keep_cross * off_right
        after_right = right - off_right + keep_cross * off_left + keep_right * off_right
        # Second stage: half of the change of the torques acts over the whole step.
        new_left, new_right = self._torques(after_left, after_right)
        more_left = 0.5 * (new_left - torque_left) / damping
        more_right = 0.5 * (new_right - torque_right) / damping
        after_left += more_left - keep_left * more_left - keep_cross * more_right
        after_right += more_right - keep_cross * more_left - keep_right * more_right
        # Friction stops a wheel, it does not turn it round; the next step decides on that.
        self.left_rad_per_s = after_left if after_left * direction_left > 0.0 else 0.0
        self.right_rad_per_s = after_right if after_right * direction_right > 0.0 else 0.0

    def _torques(self, left: float, right: float) -> tuple[float, float]:
        """Return what turns the wheels (N m), without back-EMF and friction."""
        voltage = self._base_v + self._droop_left * left + self._droop_right * right
        per_share = self._torque_per_v * voltage
        half_left, half_right, turn_left, turn_right = self._rolling
        omega = turn_right * right - turn_left * left
        # m d omega^2 pushes forward, m d omega v turns back.
        push = self._mass_ahead * omega
        forward, turn = push * omega, push * (half_left * left + half_right * right)
        return (
            per_share * self._share_left + half_left * forward + turn_left * turn,
            per_share * self._share_right + half_right * forward - turn_right * turn,
        )

    def _released(
        self, torque_left: float, torque_right: float, left: float, right: float
    ) -> tuple[float, float]:
        """Return the directions of motion; 0 for a wheel that friction holds.

        A wheel that speeds up pushes the other through the body, with the cross mass.
        """
        if not left and not right:
            if abs(torque_left) > self._breakaway_left:
                left = _sign(torque_left)
            if abs(torque_right) > self._breakaway_right:
                right = _sign(torque_right)
        if left and not right:
            speeding = torque_left - left * self._coulomb_left - self._damping * self.left_rad_per_s
            torque_right -= self._mass_cross * speeding / self._mass_left
            if abs(torque_right) > self._breakaway_right:
                right = _sign(torque_right)
        elif right and not left:
            speeding = (
                torque_right - right * self._coulomb_right - self._damping * self.right_rad_per_s
            )
            torque_left -= self._mass_cross * speeding / self._mass_right
            if abs(torque_left) > self._breakaway_left:
                left = _sign(torque_left)
        return left, right

    def _transition(self, step_us: int) -> Transition:
        rate = -self._damping * step_us / US_PER_S
        first, second = (math.exp(rate / mass) for mass in self._modes)
        (left_1, left_2), (right_1, right_2) = self._directions
        both = (
            left_1 * left_1 * first + left_2 * left_2 * second,
            left_1 * right_1 * first + left_2 * right_2 * second,
            right_1 * right_1 * first + right_2 * right_2 * second,
        )
        alone = math.exp(rate / self._mass_left), math.exp(rate / self._mass_right)
        # Timers of fixed rates make few lengths of step in lockstep; in real time there is any.
        if len(self._transitions) >= MOST_TRANSITIONS:
            self._transitions.clear()
        self._transitions[step_us] = both, alone
        return both, alone

    def _take_charge(self) -> None:
        """Count what the present duties have taken, by the current at their end."""
        seconds, self._held_us = self._held_us / US_PER_S, 0
        voltage, left, right = self.battery_v(), self._share_left, self._share_right
        current = (
            left * (left * voltage - self._back_emf * self.left_rad_per_s)
            + right * (right * voltage - self._back_emf * self.right_rad_per_s)
        ) / self._resistance_ohm
        self._battery.draw(current * seconds, seconds)


def _sign(value: float) -> float:
    return 1.0 if value > 0.0 else -1.0 if value < 0.0 else 0.0
