"""Copies a configuration with some values of a section changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from koopman_lab.config.values import Section

S = TypeVar("S", bound="Section")


def changed(config: S, section: str, **changes: Any) -> S:
    """Return the configuration with other values in one of its sections.

    The values are taken as they are: who changes them in code knows what is allowed.

    Parameters
    ----------
    config
        The lab, or one of its sections.
    section
        Name of a section in it, such as ``controller`` or ``simulation.plant``.
    changes
        The new values by their keys in the section.
    """
    first, _, rest = section.partition(".")
    inner: Section = getattr(config, first)
    other = changed(inner, rest, **changes) if rest else inner.model_copy(update=changes)
    return config.model_copy(update={first: other})
