"""What keeps the robot under way until STOP is pressed: the slalom, or a park."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from koopman_lab.bus.realtime import Listener
    from koopman_lab.config.schema import LabConfig
    from koopman_lab.geometry.planar import Pose
    from offboard.lab.supervisor import Supervisor

WAIT_S = 0.05


class Drive(Protocol):
    """Has the robot driven, again after each stop.

    Attributes
    ----------
    most_turns
        Encoder messages of 10 ms after which STOP is pressed at the latest, so that the presses
        meet the drive at any speed.
    """

    most_turns: int

    def begin(self) -> None:
        """See to it that the robot drives, once it may."""

    def end(self) -> None:
        """Wait until nothing is left of a drive that was stopped."""


class Weave:
    """The slalom, which goes on whenever it may."""

    most_turns = 150

    def __init__(self, lab: Supervisor) -> None:
        self._lab, self._started = lab, False

    def begin(self) -> None:
        """Start the slalom, the first time."""
        if not self._started:
            self._lab.start("slalom")
            self._started = True

    def end(self) -> None:
        """Go on at once."""


class Parks:
    """A controller that parks the robot at the origin, from one random start after the other."""

    most_turns = 500

    def __init__(
        self,
        lab: Supervisor,
        config: LabConfig,
        listener: Listener,
        model: Path,
        starts: Iterator[Pose],
    ) -> None:
        self._lab, self._config, self._listener = lab, config, listener
        self._model, self._starts = model.absolute(), starts

    def begin(self) -> None:
        """Place the robot and start the controller."""
        from offboard.lab.place_robot import place

        place(self._listener, self._config, next(self._starts), by_hand=False)
        self._lab.start("controller", "--model", self._model, "--goal", "0", "0", "0")

    def end(self) -> None:
        """Wait for the controller to end, as it does when the robot is stopped."""
        while not self._lab.ended("controller"):
            self._listener.spin(WAIT_S)
