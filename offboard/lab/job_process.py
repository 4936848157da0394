"""A `klab` command in a process of its own, for the page: started, asked to end, and read."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import tempfile
from collections.abc import Sequence

from koopman_lab.errors import LabStateError
from offboard.lab.python_process import module_command
from offboard.terminal.visible_text import visible

STEPS = ((0.0, signal.SIGINT), (20.0, signal.SIGTERM), (30.0, signal.SIGKILL))
"""So long after it was asked to end a command gets which signal. A session ends its own processes
in order, with up to six seconds for each."""
TAIL_BYTES = 8192
"""Of what a command has said."""


class JobProcess:
    """One command. It ends with this process, however that ends.

    Parameters
    ----------
    arguments
        Of `klab`; a list, which no shell ever reads.
    secrets
        Environment variables that are not handed on.

    Raises
    ------
    LabStateError
        If it cannot be started.
    """

    def __init__(self, arguments: Sequence[str], secrets: Sequence[str] = ()) -> None:
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 -- closed by close()
        self._lifeline_read, self._lifeline_write = os.pipe()
        environment = {k: v for k, v in os.environ.items() if k not in secrets}
        command = module_command(
            "offboard.cli.end_with_parent", str(self._lifeline_read), *arguments
        )
        try:
            self._child = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                pass_fds=[self._lifeline_read],
                env=environment,
                start_new_session=True,  # Ctrl-C in the terminal ends the page, which ends it
            )
        except OSError as error:
            self.close()
            raise LabStateError(
                f"klab {arguments[0]}: cannot be started ({error.strerror})"
            ) from None
        self._asked_s: float | None = None
        self._signals_sent = 0

    def poll(self, now_s: float) -> int | None:
        """Return the exit code, None while it runs; one that was asked to end is asked again.

        Parameters
        ----------
        now_s
            Time (s) of a clock that does not step.
        """
        code = self._child.poll()
        if code is None and self._asked_s is not None:
            due = sum(now_s - self._asked_s >= after_s for after_s, _ in STEPS)
            for _, number in STEPS[self._signals_sent : due]:
                self._child.send_signal(number)
            self._signals_sent = max(self._signals_sent, due)
        return code

    def ask_to_end(self, now_s: float) -> None:
        """Ask it to end, as Ctrl-C would."""
        if self._asked_s is None:
            self._asked_s = now_s
            self.poll(now_s)

    def said(self) -> list[str]:
        """Return the last lines of what it has said, as they may be shown."""
        size = os.fstat(self._output.fileno()).st_size
        # The child writes at the same offset, which must not be moved.
        text = os.pread(self._output.fileno(), TAIL_BYTES, max(size - TAIL_BYTES, 0))
        return [visible(line) for line in text.decode(errors="replace").splitlines() if line]

    def close(self) -> None:
        """Let go of it; one that still runs ends by that."""
        with contextlib.suppress(OSError):
            os.close(self._lifeline_write)
            os.close(self._lifeline_read)
        self._output.close()
