"""Types the lines of the guides, each that runs until Ctrl-C in a terminal of its own."""

import shlex
import signal
import subprocess
from pathlib import Path

from guide_pages.pages import LINES
from klab import KLAB, environment, klab

LIMIT_S = 60.0
ENDED = (0, 130)
"""Exit codes of what Ctrl-C ends."""


def typed(line: str) -> list[str]:
    """Return the words of a line, which must be one of the guides."""
    words = shlex.split(line)
    assert words in LINES, f"no guide has the line `{line}` any more"
    return words


def run(line: str, cwd: Path, *shorter: str) -> str:
    """Run a line to its end, expect success, return what it printed."""
    done = klab(*typed(line)[1:], *shorter, cwd=cwd)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


def by_the_shell(text: str, cwd: Path, **variables: str) -> str:
    """Let a shell run a text, expect success, return what it printed."""
    done = subprocess.run(
        ["bash", "-euc", text],
        cwd=cwd,
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}{done.stderr}"
    return done.stdout


class Terminal:
    """One in which a line runs until it is interrupted."""

    def __init__(self, line: str, cwd: Path, *shorter: str) -> None:
        self.process = subprocess.Popen(
            [*KLAB, *typed(line)[1:], *shorter],
            cwd=cwd,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )

    def __enter__(self):
        return self

    def __exit__(self, *raised) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def until(self, word: str) -> str:
        """Return the first line that holds a word."""
        said = []
        for line in self.process.stdout:
            if word in line:
                return line
            said.append(line)
        raise AssertionError(f"{self.process.args} did not say `{word}`:\n{''.join(said)}")

    def interrupt(self) -> None:
        """Press Ctrl-C, where a line runs until that."""
        self.process.send_signal(signal.SIGINT)
        self.end()

    def end(self) -> None:
        """Wait for the end of a line."""
        code = self.process.wait(timeout=LIMIT_S)
        assert code in ENDED, f"{self.process.args}: {code}\n{self.process.stdout.read()}"
