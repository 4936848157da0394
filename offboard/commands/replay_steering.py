"""What steers a replay while it waits: keys at the terminal, messages on its bus."""

from __future__ import annotations

import select
from collections.abc import Callable
from typing import TYPE_CHECKING

from koopman_lab.bus.multicast import drain
from koopman_lab.replay.bus_steering import BusSteering
from koopman_lab.replay.playback import Playback
from koopman_lab.replay.timed_replay import clock_us
from koopman_lab.units import US_PER_S

if TYPE_CHECKING:
    import lcm

    from offboard.terminal.keyboard import Keyboard

SKIP_US = 5 * US_PER_S
FASTER = 2.0


class Steering:
    """Waits in place of a replay, and meanwhile does what a person asks for.

    Parameters
    ----------
    playback
        What is steered.
    on_bus
        Does what messages ask for, and says what was done.
    bus
        Brings the messages; None where it cannot be heard.
    keyboard
        Brings the keys; None where nobody sits at a terminal.
    """

    def __init__(
        self,
        playback: Playback,
        on_bus: BusSteering,
        bus: lcm.LCM | None,
        keyboard: Keyboard | None,
    ) -> None:
        self._playback = playback
        self._on_bus = on_bus
        self._bus = bus
        self._keyboard = keyboard
        self._actions: dict[str, Callable[[int], None]] = {
            "space": playback.toggle,
            "left": lambda now_us: on_bus.seek(playback.position_us(now_us) - SKIP_US),
            "right": lambda now_us: on_bus.seek(playback.position_us(now_us) + SKIP_US),
            "up": lambda now_us: playback.set_speed(playback.speed * FASTER, now_us),
            "down": lambda now_us: playback.set_speed(playback.speed / FASTER, now_us),
        }

    def wait(self, timeout_s: float) -> None:
        """Wait for at most so long (s), until something was asked for."""
        self._on_bus.say_state_if_due()
        sources = [source for source in (self._bus, self._keyboard) if source is not None]
        readable, _, _ = select.select(sources, (), (), timeout_s)
        if self._bus in readable:
            drain(self._bus)
        if self._keyboard in readable and self._keyboard is not None:
            for key in self._keyboard.pressed():
                self._press(key)
            if not self._keyboard.is_open:
                self._keyboard = None

    def note(self) -> str:
        """Return in words how the replay goes on, empty where it does as recorded."""
        if not self._playback.playing:
            return "paused"
        return "" if self._playback.speed == 1.0 else f"{self._playback.speed:g} times as fast"

    def _press(self, key: str) -> None:
        action = self._actions.get(key)
        if action is not None:
            action(clock_us())
            self._on_bus.say_state()
