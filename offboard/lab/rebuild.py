"""Builds nodes as they were for a recorded session, so that they can run again.

The table of processes says which function is whose. Each takes the configuration, the session and
the model file that a person names, None where there is none.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from koopman_lab.bus.channel import Channel
from koopman_lab.bus.channels import MPC_STATE, REFERENCE_STATE
from koopman_lab.bus.node import Node
from koopman_lab.bus.processes import build
from koopman_lab.config.schema import LabConfig
from koopman_lab.data.decode import SessionLog
from koopman_lab.errors import ConfigError, LogError
from koopman_lab.geometry.planar import Pose


def onboard(config: LabConfig, session: SessionLog, model: Path | None) -> Node:
    """Return the motor loop."""
    del session, model
    node: Node = build("onboard", config)
    return node


def sampler(config: LabConfig, session: SessionLog, model: Path | None) -> Node:
    """Return the sampler of a session that was not resumed."""
    del session, model
    node: Node = build("sampler", config)
    return node


def reference(config: LabConfig, session: SessionLog, model: Path | None) -> Node:
    """Return the driver of the runs that the session says.

    Raises
    ------
    LogError
        If the session says none.
    """
    from offboard.reference.shapes import Shape

    del model
    node: Node = build("reference", config, Shape(_first_of(session, REFERENCE_STATE).shape))
    return node


def controller(config: LabConfig, session: SessionLog, model: Path | None) -> Node:
    """Return the controller with a model and the goal that the session says.

    Raises
    ------
    ConfigError
        If no model is named.
    LogError
        If the session says no goal.
    """
    if model is None:
        raise ConfigError(
            "--model: the controller runs again only with the model of the run; give the file "
            "that `klab park` was given"
        )
    node: Node = build("controller", config, model, Pose(*_first_of(session, MPC_STATE).goal))
    return node


def _first_of(session: SessionLog, channel: Channel[Any]) -> Any:
    """Return the first message of a node, which says what it was started for.

    Raises
    ------
    LogError
        If the log has none.
    """
    messages = session.messages(channel)
    if not messages:
        name = channel.name(session.robot_name)
        raise LogError(f"{session.path}: holds no {name}, so the node that says it did not run")
    return messages[0]
