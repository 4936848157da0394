"""Opens the page in a real browser, to measure what a person sees."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from typing import Any

from koopman_lab.errors import LabStateError

FLAGS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
MOST_TRIES, TRY_MS = 300, 200.0


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """Give a browser of playwright, None where there is no Chromium or no playwright."""
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        chromium = None
    if chromium is None:
        yield None
        return
    with sync_playwright() as play:
        launched = play.chromium.launch(executable_path=chromium, args=FLAGS)
        yield launched
        launched.close()


def visit(page: Any, address: str) -> None:
    """Open an address in a page as soon as it is served.

    Raises
    ------
    LabStateError
        If it never is.
    """
    from playwright.sync_api import Error

    for _ in range(MOST_TRIES):
        with contextlib.suppress(Error):
            page.goto(address)
            return
        page.wait_for_timeout(TRY_MS)
    raise LabStateError(f"{address}: not served; the page's process log may say why")
