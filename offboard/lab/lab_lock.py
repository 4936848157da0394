"""A lock by which only one command of this machine starts plant and onboard loop of a robot."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator

from koopman_lab.config.schema import LabConfig
from koopman_lab.errors import LabStateError
from koopman_lab.file_lock import LockHeldError, held
from koopman_lab.files import cache_folder
from offboard.lab.process_notes import FOLDER, lab_key


@contextlib.contextmanager
def lab_lock(config: LabConfig) -> Iterator[None]:
    """Hold the robot of this name, on this bus, on this machine and for this user, in the block.

    The lock goes with the process, however it ends. Who runs a lab of that name on another machine,
    or for another user, is only heard on the bus.

    Raises
    ------
    LabStateError
        If another command holds it.
    """
    # Home folders may be shared between machines.
    file = cache_folder() / FOLDER / f"{lab_key(config)}-{socket.gethostname()}.lock"
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held(file))
        except LockHeldError as holder:
            name = config.robot.name
            raise LabStateError(
                f"{holder} runs the lab of {name} already on {config.bus.url}, or is about to; end "
                f"it by Ctrl-C or `klab down --robot-name {name}`, or take another name with "
                "--robot-name R2"
            ) from None
        except OSError:
            # As with the notes: a lab runs as well where this folder cannot be written.
            pass
        yield
