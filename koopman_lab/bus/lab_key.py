"""The lab's key: a file that only its owner can read, named by ``bus.key_file``."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from koopman_lab.errors import ConfigError, NotWrittenError

if TYPE_CHECKING:
    from koopman_lab.config.schema import LabConfig

KEY_BYTES = 32
MODE = 0o600
OPEN_BUS = (
    "no key: whoever can reach this bus can drive the robot; `klab key new` makes one, and "
    "bus.key_file names it"
)


def configured_key(config: LabConfig) -> bytes | None:
    """Return the key that a configuration names, None where it names none.

    Raises
    ------
    ConfigError
        As :func:`read_key`.
    """
    file = key_path(config)
    return None if file is None else read_key(file)


def key_text(config: LabConfig) -> str:
    """Return in words who may speak on the bus.

    Raises
    ------
    ConfigError
        As :func:`read_key`.
    """
    key = configured_key(config)
    if key is None:
        return OPEN_BUS
    return f"key {fingerprint(key)}: only who has it can drive a robot, everybody can stop it"


def key_path(config: LabConfig) -> Path | None:
    """Return the file that a configuration names; ``~`` is the user's home."""
    return None if config.bus.key_file is None else Path(config.bus.key_file).expanduser()


def read_key(file: Path) -> bytes:
    """Return what a key file holds.

    Raises
    ------
    ConfigError
        If it cannot be read, is another user's or open to others, or holds no key.
    """
    try:
        # Without waiting: a pipe of this name would never answer.
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise ConfigError(
            f"bus.key_file {file}: cannot be read ({error.strerror}); copy the lab's key there, or "
            f"make the first one with `klab key new {file}`"
        ) from None
    try:
        facts = os.fstat(descriptor)
        fault = _fault(facts)
        if fault is None:
            return os.read(descriptor, KEY_BYTES)
    finally:
        os.close(descriptor)
    raise ConfigError(f"bus.key_file {file}: {fault}")


def _fault(facts: os.stat_result) -> str | None:
    """Return why a file is no key of ours, None if it is one."""
    if not stat.S_ISREG(facts.st_mode):
        return "is no file; name the one that `klab key new` made"
    if facts.st_uid != os.geteuid():
        return (
            f"belongs to user {facts.st_uid}, and this is user {os.geteuid()}; copy it as this user"
        )
    if facts.st_mode & 0o077:
        return (
            f"mode {facts.st_mode & 0o777:o} lets others read it; take a new key if one may have, "
            "else chmod 600"
        )
    if facts.st_size != KEY_BYTES:
        return f"holds {facts.st_size} bytes, and a key has {KEY_BYTES}; copy it once more"
    return None


def write_new_key(file: Path) -> bytes:
    """Make a key, whole or not at all, that only its owner can read; return it.

    Raises
    ------
    ConfigError
        If there is such a file already.
    NotWrittenError
        If it cannot be written.
    """
    # Here, as in `fingerprint`: who stops a robot reads the key, and is not to wait for the rest.
    import tempfile

    key = os.urandom(KEY_BYTES)
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
        temporary = Path(name)
        try:
            with os.fdopen(handle, "wb") as opened:
                os.fchmod(opened.fileno(), MODE)
                opened.write(key)
                opened.flush()
                os.fsync(opened.fileno())
            # Unlike a renaming, this never takes the place of a file that is there.
            os.link(temporary, file)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    except OSError as error:
        if error.errno == errno.EEXIST:
            raise ConfigError(
                f"{file}: is there already, and a key is never overwritten; name another file, or "
                "move the old key away first if every machine is to have a new one"
            ) from None
        raise NotWrittenError(
            f"{file}: cannot be written ({error.strerror}); name another file"
        ) from None
    return key


def fingerprint(key: bytes) -> str:
    """Return by what people compare keys on two machines; it tells nothing of the key."""
    import hashlib

    return hashlib.sha256(b"koopman-lab key\0" + key).hexdigest()[:16]
