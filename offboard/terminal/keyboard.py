"""Single keys that a person presses at a terminal, while something else goes on."""

from __future__ import annotations

import os
import re
import signal
import sys
import termios
import tty
from types import FrameType, TracebackType

TERMINATED = 128 + signal.SIGTERM
"""Exit code, as a shell has it."""
_KEY = re.compile(rb"\x1b[\[O][0-9;]*([A-Za-z~])|(.)", re.DOTALL)
"""An escape sequence of ECMA-48 (CSI), or of a VT100 in application mode (SS3); or one byte."""
_SEQUENCES = {
    b"A": "up",
    b"B": "down",
    b"C": "right",
    b"D": "left",
    b"H": "home",
    b"F": "end",
}


def key_names(typed: bytes) -> list[str]:
    """Return the keys that stand behind what a terminal sent; those without a name are left out."""
    names = []
    for key in _KEY.finditer(typed):
        sequence, character = key.groups()
        if sequence is not None:
            names.append(_SEQUENCES.get(sequence, ""))
        elif character == b" ":
            names.append("space")
        elif character.isalnum():
            names.append(character.decode())
    return [name for name in names if name]


def has_keyboard() -> bool:
    """Return whether somebody sits at a terminal and types to this program.

    A program in the background of a shell would be stopped for touching the terminal.
    """
    try:
        return os.isatty(0) and os.tcgetpgrp(0) == os.getpgrp()
    except OSError:
        return False


class Keyboard:
    """Inside its block each key comes at once and none is shown; Ctrl-C interrupts as ever.

    However the block ends, the terminal is as it was.
    """

    def __init__(self) -> None:
        self.is_open = True
        """Whether more can come: not once the terminal is gone."""

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when a key is pressed."""
        return 0

    def pressed(self) -> list[str]:
        """Return the names of the keys that were pressed; call when there are any."""
        typed = os.read(0, 1024)
        self.is_open = bool(typed)
        return key_names(typed)

    def __enter__(self) -> Keyboard:
        self._before = termios.tcgetattr(0)
        # Ended by force, a program would leave a terminal that shows nothing that is typed.
        self._on_end = signal.signal(signal.SIGTERM, _end)
        tty.setcbreak(0)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        termios.tcsetattr(0, termios.TCSADRAIN, self._before)
        signal.signal(signal.SIGTERM, self._on_end)


def _end(number: int, frame: FrameType | None) -> None:
    del number, frame
    sys.exit(TERMINATED)
