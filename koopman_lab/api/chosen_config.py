"""The configuration that keyword arguments ask for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from koopman_lab.api.arguments import FilePath
from koopman_lab.config.layer import merge
from koopman_lab.config.load import load_config, parse_config
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
        Values by the keys of the section ``controller``; NumPy's numbers and arrays as well.
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
    plain = {key: _plain(value) for key, value in settings.items()}
    if not isinstance(config, LabConfig):
        file = None if config is None else Path(config)
        overrides = [f"{SECTION}.{key}={_flow(value)}" for key, value in plain.items()]
        return load_config(file, robot=robot, preset=preset, overrides=overrides)
    if robot is not None and robot != config.robot.kind:
        raise ConfigError(
            f"the configuration is of the {config.robot.kind} robot, not of the {robot} one; "
            "leave one of them out"
        )
    if not plain:
        return config
    values = merge(config.model_dump(mode="json"), {SECTION: plain})
    return parse_config(yaml.safe_dump(values, sort_keys=False), "configuration with settings")


def _plain(value: Any) -> Any:
    """Return a value as YAML can hold it."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value


def _flow(value: Any) -> str:
    """Return a value as YAML on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=float("inf"))
    return text.removesuffix("...\n").strip()
