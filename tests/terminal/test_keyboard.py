"""Keys at a terminal: what they are called, and a terminal that is left as it was."""

import os
import pty
import signal
import subprocess
import sys
import termios

import pytest
from klab import controlled_by, environment

from offboard.terminal.keyboard import TERMINATED, key_names

WORK = """
import select
from offboard.terminal.keyboard import Keyboard, has_keyboard
assert has_keyboard()
with Keyboard() as keyboard:
    print("ready", flush=True)
    while True:
        select.select([keyboard], (), ())
        print(*keyboard.pressed(), flush=True)
"""


@pytest.mark.parametrize(
    ("typed", "names"),
    [
        (b"", []),
        (b" ", ["space"]),
        (b"q7", ["q", "7"]),
        (b"\x1b[A\x1b[B\x1b[C\x1b[D", ["up", "down", "right", "left"]),
        (b"\x1bOC\x1bOD", ["right", "left"]),
        (b"\x1b[1;5C", ["right"]),
        (b"\x1b[H\x1b[F", ["home", "end"]),
        # What has no name here, or is no whole sequence, is no other key.
        (b"\x1b[5~\x1b\x1b[\n\xff", []),
        (b"\x1b[5~ ", ["space"]),
    ],
)
def test_keys_have_names(typed, names):
    assert key_names(typed) == names


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_keys_come_at_once_and_the_terminal_is_left_as_it_was(end):
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    program = subprocess.Popen(
        [sys.executable, "-c", WORK],
        stdin=theirs,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment(),
        start_new_session=True,
        preexec_fn=controlled_by(theirs),
    )
    with program:
        assert program.stdout.readline() == "ready\n"
        assert not termios.tcgetattr(theirs)[3] & (termios.ECHO | termios.ICANON)
        os.write(ours, b" \x1b[C")
        assert program.stdout.readline().split() == ["space", "right"]
        program.send_signal(end)
        code = program.wait(timeout=30)
    assert code == (TERMINATED if end == signal.SIGTERM else -signal.SIGINT)
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)
