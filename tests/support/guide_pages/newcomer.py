"""A newcomer types the README's ten minutes and its Python, and looks whether it shows the same.

By hand, from an empty folder and with an installation of its own: ./scripts/newcomer.
"""

import contextlib
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from guide_pages.pages import ROOT, blocks, section
from guide_pages.shown_output import first_difference
from guide_pages.terminals import ENDED, LIMIT_S

from koopman_lab.bus.channels import MPC_STATE
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from offboard.bench.browser import browser, visit

ACTIVATE = "source .venv/bin/activate"
PAGE = "klab up --view"
PARK = (
    "klab park --model runs/demo/model.npz --set controller.parked_hold_s=60 "
    "--set controller.time_limit_s=300 --out runs/first-park"
)
GOAL = {"x1 (m)": 0.3, "x2 (m)": 0.2, "heading (°)": 45.0}
"""What the newcomer fills in on the page, by the labels of the fields."""
MOST_WAITS, WAIT_S = 2400, 0.05
CLOSE_M = 1e-6


class Seen(NamedTuple):
    """What the newcomer has reached, and after how long (s)."""

    what: str
    after_s: float


def shell(line: str, folder: Path) -> list[str]:
    """Return the words that have a shell type a line in the environment of a checkout."""
    enter = f"{ACTIVATE}; " if (folder / ".venv" / "bin" / "activate").exists() else ""
    return ["bash", "-c", f"{enter}exec {line}"]


class Newcomer:
    """Reads the README from its first block to its last and does what they say.

    Parameters
    ----------
    folder
        The checkout.
    types
        Runs a line to its end, expects success, and returns what it printed.
    page_options, park_options
        What is added to the two commands that run in real time.
    """

    def __init__(
        self,
        folder: Path,
        types: Callable[[str], str],
        page_options: Sequence[str] = (),
        park_options: Sequence[str] = (),
    ) -> None:
        self._folder = folder
        self._types = types
        self._options = {PAGE: page_options, PARK: park_options}
        self._address = ""

    def reads(self) -> Iterator[Seen]:
        """Give what was reached, as soon as it is.

        Raises
        ------
        AssertionError
            If something does not work, or does not print what the README shows.
        """
        began_s, printed = time.monotonic(), ""
        text = section("README.md", "Ten minutes") + section("README.md", "In Python")
        with contextlib.ExitStack() as terminals:
            for language, inside in blocks(text):
                if not language:
                    missing = first_difference(inside, printed)
                    assert missing is None, f"the README shows `{missing}`; printed:\n{printed}"
                    continue
                printed = ""
                lines = [inside] if language == "python" else inside.splitlines()
                for line in lines:
                    if language == "python":
                        printed += self._types(f"python -c {shlex.quote(line)}")
                    elif line == PAGE:
                        self._address = terminals.enter_context(self._page())
                    elif line == PARK:
                        printed += self._park_and_steer()
                    else:
                        printed += self._types(line)
                    yield Seen(line.strip().splitlines()[0], time.monotonic() - began_s)

    def _start(self, line: str) -> subprocess.Popen[str]:
        added = shlex.join(map(str, self._options[line]))
        return subprocess.Popen(
            shell(f"{line} {added}", self._folder),
            cwd=self._folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )

    @contextlib.contextmanager
    def _page(self) -> Iterator[str]:
        """Start the lab with its page; give the address that it prints."""
        lab = self._start(PAGE)
        try:
            said = ""
            for line in lab.stdout:
                said += line
                if "http://" in line:
                    break
            assert "http://" in said, said
            yield f"http://{said.partition('http://')[2].split()[0]}"
        finally:
            lab.send_signal(signal.SIGINT)
            rest, _ = lab.communicate(timeout=LIMIT_S)
        assert lab.returncode in ENDED, rest

    def _park_and_steer(self) -> str:
        """Park the robot, and send it elsewhere by the page while it drives."""
        steps = []
        bus = Listener(load_config(bus_url=None, overrides=_bus_overrides()))
        bus.subscribe(MPC_STATE, steps.append)
        park = self._start(PARK)
        with browser() as chromium:
            assert chromium is not None, "no Chromium here: sudo apt install chromium"
            page = chromium.new_page()
            visit(page, self._address)
            _wait(bus, lambda: steps and steps[-1].state == steps[-1].DRIVING)
            for label, value in GOAL.items():
                page.get_by_label(label, exact=True).fill(str(value))
            page.get_by_role("button", name="Send goal").click()
            _wait(bus, lambda: abs(steps[-1].goal[0] - GOAL["x1 (m)"]) < CLOSE_M)
            page.close()
        printed, _ = park.communicate(timeout=MOST_WAITS * WAIT_S)
        assert park.returncode == 0, printed
        return printed


def _bus_overrides() -> list[str]:
    import os

    url = os.environ.get("LCM_DEFAULT_URL")
    return [f"bus.url={url}"] if url else []


def _wait(bus: Listener, condition: Callable[[], object]) -> None:
    for _ in range(MOST_WAITS):
        if condition():
            return
        bus.spin(WAIT_S)
    raise AssertionError("the robot did not do so in time")


def main() -> None:
    """Clone this checkout into an empty folder, install it there, and go through the README."""
    with tempfile.TemporaryDirectory() as empty:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else empty) / "koopman-lab"
        subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)

        def types(line: str) -> str:
            done = subprocess.run(
                shell(line, folder) if line != ACTIVATE else ["true"],
                cwd=folder,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{line}\n{done.stdout}"
            return done.stdout

        for what, after_s in Newcomer(folder, types).reads():
            sys.stdout.write(f"{after_s:7.1f} s  {what}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
