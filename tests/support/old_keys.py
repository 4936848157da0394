"""Configurations in the keys of the version before radio, cameras and plant had their section."""

from collections.abc import Mapping

import yaml

from koopman_lab.config.load import dump_config
from koopman_lab.config.moved_keys import MOVED


def leaves(values, above=()):
    """Return all values by their whole keys."""
    named = {}
    for key, value in values.items():
        inside = isinstance(value, Mapping)
        named |= leaves(value, (*above, key)) if inside else {(*above, key): value}
    return named


def nested(named):
    """Return a configuration from values by their whole keys."""
    values = {}
    for key, value in named.items():
        section = values
        for part in key[:-1]:
            section = section.setdefault(part, {})
        section[key[-1]] = value
    return values


def as_it_was(key):
    """Return the old name of a present key, if it has moved."""
    for old, new in MOVED.items():
        if key[: len(new)] == new:
            return old + key[len(new) :]
    return key


def old_dump(config):
    """Return the whole configuration as YAML of the version before."""
    present = leaves(yaml.safe_load(dump_config(config)))
    return yaml.safe_dump(nested({as_it_was(key): value for key, value in present.items()}))
