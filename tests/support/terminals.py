"""Types the README's lines, each that runs until Ctrl-C in a terminal of its own."""

import re
import shlex
import signal
import subprocess
from pathlib import Path

from klab import KLAB, klab

README = (Path(__file__).parents[2] / "README.md").read_text()
HEREDOC = re.compile(r"^cat > (\S+) <<'END'\n(.*?)^END\n", re.M | re.S)


def words_of(text: str) -> list[list[str]]:
    """Return the words of each line in the shell blocks of a text, but for what goes into files."""
    return [
        words
        for block in re.findall(r"^```bash\n(.*?)^```", text, re.M | re.S)
        for line in HEREDOC.sub("", block).splitlines()
        if (words := shlex.split(line, comments=True))
    ]


_BEFORE, _, _REST = README.partition("\n## Your first hour\n")
HOUR, _, _BEHIND = _REST.partition("\n## What a person does here\n")
"""The README's section of this name."""
FIRST, LATER = words_of(f"{_BEFORE}{HOUR}"), words_of(_BEHIND)
"""The lines up to the end of the first hour, and those behind it, in order."""
REPLAYS = "udpm://239.255.76.68:7668?ttl=0"
"""The bus that the README keeps for replays."""
LIMIT_S = 60.0
ENDED = (0, 130)
"""Exit codes of what Ctrl-C ends."""


def typed(line: str) -> list[str]:
    """Return the words of a line, which must be one of the README."""
    words = shlex.split(line)
    assert words in [*FIRST, *LATER], f"README: has no line `{line}` any more"
    return words


def run(line: str, cwd: Path, *shorter: str) -> str:
    """Run a line to its end, expect success, return what it printed."""
    done = klab(*typed(line)[1:], *shorter, cwd=cwd)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
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
        return next(line for line in self.process.stdout if word in line)

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(timeout=LIMIT_S) in ENDED
