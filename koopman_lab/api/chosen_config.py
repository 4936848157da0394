"""The configuration that keyword arguments ask for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from koopman_lab.api.arguments import FilePath
from koopman_lab.config.load import load_config, with_settings
from koopman_lab.config.presets import Preset
from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import ConfigError

SECTION = "controller"
"""Whose keys the keyword arguments are."""


def chosen_config(
    config: LabConfig | FilePath | None,
    robot: str | None,
    settings: Mapping[str, Any],
    *,
    preset: str = Preset.lab,
) -> LabConfig:
    """Return a configuration with other settings of the controller.

    Parameters
    ----------
    config
        A configuration, a YAML file with any part of one, or None for the defaults.
    robot
        The robot's kind, where the configuration does not say it.
    settings
        Values by the keys of the section ``controller``; NumPy's as well.
    preset
        What is simulated, where ``config`` is no whole configuration.

    Raises
    ------
    ConfigError
        If something cannot be read or is not allowed; the message names the key, what is allowed
        and the nearest valid key.
    PluginError
        If the robot is another package's, and cannot be used.
    """
    chosen = {SECTION: settings} if settings else {}
    if not isinstance(config, LabConfig):
        return load_config(config, robot=robot, preset=preset, settings=chosen)
    if robot is not None and robot != config.robot.kind:
        raise ConfigError(
            f"the configuration is of the {config.robot.kind} robot, not of the {robot} one; "
            "leave one of them out"
        )
    return with_settings(config, chosen) if chosen else config
