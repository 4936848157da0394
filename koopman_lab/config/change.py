"""A configuration like another, with some values of a section changed."""

from __future__ import annotations

from typing import Any

from koopman_lab.config.schema import LabConfig


def changed(config: LabConfig, section: str, **changes: Any) -> LabConfig:
    """Return the configuration with other values in one of its sections.

    The values are taken as they are: who changes them in code knows what is allowed.

    Parameters
    ----------
    config
        The lab.
    section
        Name of a section, such as ``controller``.
    changes
        Values by their keys in the section.
    """
    other = getattr(config, section).model_copy(update=changes)
    return config.model_copy(update={section: other})
