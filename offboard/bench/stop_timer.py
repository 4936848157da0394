"""When the motors of a robot were at zero, and when its wheels stood."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from koopman_lab.bus.channels import ENCODER, MOTOR_CMD, ONBOARD_STATUS, WHEEL_STATE
from koopman_lab.errors import LabStateError

if TYPE_CHECKING:
    import lcmtypes
    from koopman_lab.bus.realtime import Listener

MOST_WAITS = 10_000
"""At 200 messages a second, and to start who drives may take a while."""
WAIT_S = 0.05
STANDING = 100
"""Encoder messages without a count after which the robot has arrived: 1 s."""
MOST_KEPT = 4000
"""Of the newest duties and counts each: 40 s."""


class StopTimer:
    """Listens to a robot's motors and encoders.

    Parameters
    ----------
    listener
        Of that robot, in the process that waits.
    """

    def __init__(self, listener: Listener) -> None:
        self.status: lcmtypes.onboard_status_t | None = None
        """The newest of the motor loop."""
        self.speeds = (0.0, 0.0)
        """The newest (v, omega) in m/s and rad/s, as the wheels say."""
        self._listener = listener
        self._duties: deque[lcmtypes.motor_command_t] = deque(maxlen=MOST_KEPT)
        self._counts: deque[lcmtypes.encoder_t] = deque(maxlen=MOST_KEPT)
        listener.subscribe(MOTOR_CMD, self._duties.append)
        listener.subscribe(ENCODER, self._counts.append)
        listener.subscribe(WHEEL_STATE, self._on_wheels)
        listener.subscribe(ONBOARD_STATUS, self._on_status)

    def turn(self, messages: int = 1) -> bool:
        """Wait until an encoder has counted between so many messages; return whether it turns.

        It does not where the wheels came to stand before, for :data:`STANDING` messages.

        Raises
        ------
        LabStateError
            If they never begin to turn.
        """
        self._forget()
        turned = still = 0

        def turned_enough() -> bool:
            nonlocal turned, still
            while len(self._counts) > 1:
                still = still + 1 if self._same(self._counts[0], self._counts[1]) else 0
                turned += not still
                self._counts.popleft()
            return (turned >= messages and not still) or (turned > 0 and still >= STANDING)

        self._until(turned_enough, "turn")
        return not still

    def stop_after(self, pressed_us: int) -> tuple[int, int]:
        """Return how long after a moment (us) the motors were at zero and the wheels stood (us).

        Standing is what the motor loop takes for it: no count within one of its ticks.

        Raises
        ------
        LabStateError
            If they never do.
        """

        def stood() -> bool:
            while len(self._counts) > 1 and not (
                self._counts[0].utime > pressed_us and self._same(self._counts[0], self._counts[1])
            ):
                self._counts.popleft()
            return len(self._counts) > 1 and self._zero_after(pressed_us) is not None

        self._until(stood, "stop")
        zero_us = self._zero_after(pressed_us)
        assert zero_us is not None
        return zero_us - pressed_us, self._counts[0].utime - pressed_us

    def _zero_after(self, pressed_us: int) -> int | None:
        return next(
            (
                int(duty.utime)
                for duty in self._duties
                if duty.utime > pressed_us and duty.left_duty == duty.right_duty == 0.0
            ),
            None,
        )

    def _forget(self) -> None:
        while self._listener.spin(0.0):
            pass
        self._duties.clear()
        self._counts.clear()

    def _until(self, condition: Callable[[], bool], what: str) -> None:
        for _ in range(MOST_WAITS):
            while self._listener.spin(0.0):
                pass
            if condition():
                return
            self._listener.spin(WAIT_S)
        raise LabStateError(f"the wheels do not {what}; the processes' logs may say why")

    def _on_wheels(self, message: lcmtypes.wheel_state_t) -> None:
        self.speeds = message.v_m_per_s, message.omega_rad_per_s

    def _on_status(self, message: lcmtypes.onboard_status_t) -> None:
        self.status = message

    @staticmethod
    def _same(before: lcmtypes.encoder_t, after: lcmtypes.encoder_t) -> bool:
        return (before.left_count, before.right_count) == (after.left_count, after.right_count)
