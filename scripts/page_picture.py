"""Take a picture of the page while the robot is parked; ./scripts/show-page calls this."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from koopman_lab.bus.channels import MPC_STATE
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from offboard.bench.browser import browser, visit
from offboard.commands.view import free_port

ROOT = Path(__file__).parents[1]
MODEL = ROOT / "tests" / "data" / "reference" / "model.npz"
URL = "udpm://239.255.76.68:7669?ttl=0"
"""A bus of its own, so that no lab that runs here is seen."""
SIZE = {"width": 1366, "height": 768}
STEPS = 70
"""Of the controller, after which the picture is taken: on the way, with most of the trail drawn."""
MOST_WAITS, WAIT_S = 1200, 0.05
LARGEST_BYTES = 200_000
COLOURS = 256


@contextlib.contextmanager
def klab(*arguments: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command of `klab` as long as the block lasts."""
    words = [sys.executable, "-m", "offboard.cli.main", *map(str, arguments), "--url", URL]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def take(picture: Path, folder: Path) -> None:
    """Start a lab and a park, and take the picture on the way."""
    steps: list[int] = []
    bus = Listener(load_config(overrides=[f"bus.url={URL}"]))
    bus.subscribe(MPC_STATE, lambda state: steps.append(state.state == state.DRIVING))
    port = free_port()
    with (
        browser() as chromium,
        klab("up", "--view", "--port", str(port), "--out", folder / "up"),
    ):
        if chromium is None:
            sys.exit("there is no Chromium here: sudo apt install chromium")
        page = chromium.new_page(viewport=SIZE)
        visit(page, f"http://127.0.0.1:{port}/")
        start = ("--start", "0", "0.5", "0")
        with klab("park", "--model", MODEL, *start, "--out", folder / "park"):
            for _ in range(MOST_WAITS):
                if sum(steps) >= STEPS:
                    break
                bus.spin(WAIT_S)
            else:
                sys.exit("the robot was not driven; klab doctor may say why")
            page.screenshot(path=picture)
    # Few colours are in it, and a README is to be there at once.
    Image.open(picture).quantize(COLOURS).save(picture, optimize=True)
    size = picture.stat().st_size
    print(f"{picture}: {size} bytes")
    if size > LARGEST_BYTES:
        sys.exit(f"more than {LARGEST_BYTES} bytes")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python scripts/page_picture.py FILE.png")
    with tempfile.TemporaryDirectory() as place:
        take(Path(sys.argv[1]), Path(place))
