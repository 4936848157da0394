"""A real browser, and pages in it that are closed after each test."""

import contextlib

import pytest
from browser.patience import PATIENCE_MS

from offboard.bench.browser import browser, visit


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture
def opened(chromium):
    """Give what opens a page as soon as it is served; a page left open would go on to draw."""
    with contextlib.ExitStack() as contexts:

        def open_page(address, **settings):
            context = chromium.new_context(**settings)
            contexts.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(PATIENCE_MS)
            visit(page, address)
            return page

        yield open_page
