"""What tells one kind of session from another; ``session_runner.run_session`` runs any of them.

A kind of session is a class with the interface of :class:`SessionKind`. It says how the node that
commands is made in this process and by which arguments in a process of its own, and how far
both are. How the lab around it is started, watched and ended is the same for all.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.node import Node
from koopman_lab.config.schema import LabConfig
from koopman_lab.geometry.planar import Pose
from offboard.desk.results import Result
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_watch import START_LIMIT_S


class Progress(NamedTuple):
    """How far a session is: ``done`` of ``total`` in the kind's unit, and a few words."""

    done: float
    total: float
    note: str = ""


Outcome = TypeVar("Outcome", bound=Result)
N = TypeVar("N", bound=Node)


class SessionKind(ABC, Generic[N, Outcome]):
    """A session in which one node commands the robot until its work is done."""

    node_name: ClassVar[str]
    """Of the node that commands, as in ``klab run NAME`` and in who holds the robot."""
    doing: ClassVar[str]
    """What is done, in a word for a person."""
    unit: ClassVar[str]
    """Of the progress."""
    state_channel: ClassVar[Channel[Any]]
    """On which the node says how far it is."""
    outcome_type: type[Outcome]
    """Of what the node brings."""
    start: Pose | None = None
    """Where the robot is placed before the node is started (m, m, rad); None to leave it."""
    resume_us: int | None = None
    """Virtual time (us) from which on an interrupted session goes on; None to begin one."""

    @abstractmethod
    def make_node(self, config: LabConfig) -> N:
        """Return the node.

        Raises
        ------
        LabError
            If it cannot do its work as configured.
        """

    @abstractmethod
    def outcome(self, node: N, missed_deadlines: int) -> Outcome:
        """Return what the node has brought."""

    @abstractmethod
    def arguments(self) -> tuple[str | Path, ...]:
        """Return the arguments by which ``klab run`` makes the same node in its own process."""

    @abstractmethod
    def limit_s(self, config: LabConfig) -> float:
        """Return the virtual time (s) after which a session that does not end is given up."""

    @abstractmethod
    def progress(self, node: N, elapsed_s: float, config: LabConfig) -> Progress:
        """Return how far a node in this process is, at ``elapsed_s`` of virtual time."""

    @abstractmethod
    def progress_reported(self, state: Any, elapsed_s: float, config: LabConfig) -> Progress:
        """Return how far a node is by its message, ``elapsed_s`` after its first one."""

    @abstractmethod
    def has_begun(self, state: Any) -> bool:
        """Return whether the node's message says that it waits for nothing more."""

    @abstractmethod
    def waits_for(self, config: LabConfig) -> str:
        """Return what the node needs to begin, and what a person can do about it."""

    def start_limit_s(self, config: LabConfig) -> float:
        """Return the time (s) in which the node must have begun."""
        del config
        return START_LIMIT_S

    def after_interruption(self, folder: RunFolder, *, lockstep: bool) -> str:
        """Return what a person can do with a session that broke; nothing if there is nothing."""
        del folder, lockstep
        return ""
