"""The page in a real browser, for the benches that ask what a person sees of it."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from typing import Any

FLAGS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
MOST_TRIES, TRY_MS = 150, 200.0


@contextlib.contextmanager
def page_at(address: str) -> Iterator[Any]:
    """Give the page in a real browser, None where there is none."""
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import Error, sync_playwright
    except ModuleNotFoundError:
        chromium = None
    if chromium is None:
        yield None
        return
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page()
        for _ in range(MOST_TRIES):
            with contextlib.suppress(Error):
                page.goto(address)
                break
            page.wait_for_timeout(TRY_MS)
        yield page
        browser.close()
