"""The battery: terminal voltage under load, and what is left in it."""

from __future__ import annotations

from koopman_lab.config import simulation

SECONDS_PER_HOUR = 3600.0


class Battery:
    """A voltage source that falls linearly with its charge, behind a resistance.

    Parameters
    ----------
    battery
        The battery's section of the configuration.
    motor_resistance_ohm
        Resistance of one motor; both hang on the battery through their drivers.
    """

    def __init__(self, battery: simulation.Battery, motor_resistance_ohm: float) -> None:
        self.state_of_charge = battery.state_of_charge
        self._empty_v = battery.empty_v
        self._span_v = battery.full_v - battery.empty_v
        self._capacity_as = battery.capacity_ah * SECONDS_PER_HOUR
        self._board_current_a = battery.board_current_a
        self._board_drop_v = battery.resistance_ohm * battery.board_current_a
        self._resistance_ratio = battery.resistance_ohm / motor_resistance_ohm
        self.held_v: float | None = None
        """Voltage at which a fault holds the terminals whatever the load, None without."""

    def terminal(self, left_share: float, right_share: float) -> tuple[float, float, float]:
        """Return ``(base_v, left, right)``: the voltage is ``base_v + left * e_l + right * e_r``.

        A driver that passes the share ``s`` of the terminal voltage U to a motor with back-EMF e
        takes the current ``s (s U - e) / R`` from the battery, since an ideal driver keeps the
        power. Solved for U, this is linear in the back-EMFs (V).
        """
        if self.held_v is not None:
            return self.held_v, 0.0, 0.0
        ratio = self._resistance_ratio
        scale = 1.0 / (1.0 + ratio * (left_share * left_share + right_share * right_share))
        open_circuit_v = self._empty_v + self.state_of_charge * self._span_v
        base_v = scale * (open_circuit_v - self._board_drop_v)
        return base_v, scale * ratio * left_share, scale * ratio * right_share

    def draw(self, motor_charge_as: float, seconds: float) -> None:
        """Take charge (A s) for the motors, and what the board needs in ``seconds``."""
        used = motor_charge_as + self._board_current_a * seconds
        left = self.state_of_charge - used / self._capacity_as
        self.state_of_charge = left if 0.0 <= left <= 1.0 else 0.0 if left < 0.0 else 1.0
