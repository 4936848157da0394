"""Says on the bus where a replay is, and does what listeners ask of it there.

Each robot of the log has a REPLAY_STATE and a REPLAY_CONTROL of its own, so that whoever shows one
robot finds both; they steer one and the same replay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple, Protocol

import lcmtypes
from koopman_lab.bus.channel import Channel, M
from koopman_lab.bus.channels import REPLAY_CONTROL, REPLAY_STATE
from koopman_lab.replay.playback import Playback
from koopman_lab.units import US_PER_S

if TYPE_CHECKING:
    from koopman_lab.bus.filtered_bus import FilteredBus
    from koopman_lab.config.schema import LabConfig

STATE_PERIOD_US = 200_000
"""So often it is said where the replay is, and at once after it was steered."""


class Control(NamedTuple):
    """What is asked of a replay.

    Attributes
    ----------
    action
        One of the constants of ``replay_control_t``.
    value
        What the action needs: a moment of the log (s), or a speed; otherwise 0.
    """

    action: int
    value: float = 0.0


def control_message(control: Control, number: int, utime: int) -> lcmtypes.replay_control_t:
    """Return the message that asks for it.

    Parameters
    ----------
    control
        What is asked for.
    number
        Time when it was asked for (us), the same whenever it is repeated.
    utime
        Present time (us).
    """
    message = lcmtypes.replay_control_t()
    message.utime, message.number = utime, number
    message.action, message.value = control
    return message


class Port(Protocol):
    """What is needed of the bus; a :class:`~koopman_lab.bus.realtime_port.RealtimePort` is one."""

    def publish(self, channel: Channel[M], message: M) -> None:
        """Send a message."""

    def now_us(self) -> int:
        """Return the present time (us)."""


class BusSteering:
    """Steers a playback by messages.

    Parameters
    ----------
    playback
        What is steered.
    clock_us
        Returns the time that the playback goes by (us).
    show_present
        Called after the replay went on at another moment; see
        :meth:`~koopman_lab.replay.timed_replay.Replay.show_present`.
    """

    def __init__(
        self,
        playback: Playback,
        clock_us: Callable[[], int],
        show_present: Callable[[], object],
    ) -> None:
        self._playback = playback
        self._clock_us = clock_us
        self._show_present = show_present
        self._ports: list[Port] = []
        self._seeks = self._obeyed = 0
        self._due_us = -math.inf

    def attach(self, port: Port) -> None:
        """Say the state also on this port, which brings messages to :meth:`take`."""
        self._ports.append(port)

    def take(self, message: lcmtypes.replay_control_t) -> None:
        """Do what is asked for, once; what is no number, or unknown, is passed over.

        So is what says that it was asked for later than it was sent: nobody could ask for anything
        after it.
        """
        is_new = self._obeyed < message.number <= message.utime
        if not is_new or not math.isfinite(message.value):
            return
        self._obeyed = message.number
        playback, now_us = self._playback, self._clock_us()
        if message.action in (message.PAUSE, message.PLAY):
            playback.set_playing(message.action == message.PLAY, now_us)
        elif message.action == message.SEEK:
            self.seek(round(min(max(message.value, 0.0), 1e9) * US_PER_S))
            return  # which says so before it shows that moment
        elif message.action == message.SPEED and message.value > 0.0:
            playback.set_speed(message.value, now_us)
        self.say_state()

    def seek(self, position_us: int) -> None:
        """Go on at another moment of the log (us), and show it to whoever listens."""
        self._seeks += 1
        self._playback.seek(position_us, self._clock_us())
        self.say_state()
        self._show_present()

    def say_state_if_due(self) -> None:
        """Say where the replay is, where that was not said lately."""
        if self._clock_us() >= self._due_us:
            self.say_state()

    def say_state(self) -> None:
        """Say where the replay is, and whether it goes on."""
        now_us = self._clock_us()
        self._due_us = now_us + STATE_PERIOD_US
        playback = self._playback
        for port in self._ports:
            state = lcmtypes.replay_state_t()
            state.utime = port.now_us()
            state.position_s = playback.position_us(now_us) / US_PER_S
            state.start_s = playback.start_us / US_PER_S
            state.end_s = playback.end_us / US_PER_S
            state.speed, state.loop = playback.speed, playback.loop
            state.playing, state.seeks = playback.playing, self._seeks
            state.control = self._obeyed
            port.publish(REPLAY_STATE, state)


def attach_to_bus(
    steering: BusSteering, config: LabConfig, bus: FilteredBus, robots: Iterable[str]
) -> None:
    """Let a replay be steered on the bus that it is sent on.

    Parameters
    ----------
    steering
        What takes the messages.
    config
        Names the bus.
    bus
        Opened; whoever reads it hands the messages over.
    robots
        Those of the log.

    Raises
    ------
    BusError
        If the bus can be sent on, but not heard.
    """
    from koopman_lab.bus.realtime_port import RealtimePort

    for robot in robots:
        port = RealtimePort("", config, bus, None)
        port.robot_name = robot
        port.subscribe(REPLAY_CONTROL, steering.take)
        port.listen()
        steering.attach(port)
