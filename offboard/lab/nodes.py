"""The nodes of a lab on virtual time, built by the table of processes."""

from __future__ import annotations

from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.node import Node
from koopman_lab.bus.processes import build
from koopman_lab.config.schema import LabConfig
from koopman_lab.emulation.board import emulated_board
from offboard.lab.run_folder import RunFolder
from offboard.lab.session_watch import RobotWatchNode


def logger(config: LabConfig, folder: RunFolder, *, resume: bool = False) -> Node:
    """Return the logger of a run folder."""
    node: Node = build("logger", config, folder.log, resume=resume)
    return node


def lockstep_lab(
    config: LabConfig, folder: RunFolder, commander: Node, resume_us: int | None = None
) -> Lockstep:
    """Return the whole lab on virtual time, with ``commander`` driving the robot.

    With ``resume_us`` (us) it goes on behind the log that is there, from this time on.
    """
    resume = resume_us is not None
    lab = Lockstep(config, resume_us or 0)
    add_robot(lab, config)
    for node in (logger(config, folder, resume=resume), commander, RobotWatchNode(config)):
        lab.add(node)
    return lab


def add_robot(lab: Lockstep, config: LabConfig) -> None:
    """Add the plant, and the motor loop behind the radio and the clock of a simulated board."""
    lab.add(build("plant", config))
    lab.add(build("onboard", config), emulated_board(config))
