"""The page in a real browser, with the lab as it runs behind it."""

import contextlib
import os
import re
import shutil
import signal
import socket

import pytest
from klab import MODEL, start_klab
from playwright.sync_api import Error, expect, sync_playwright

from koopman_lab.bus.channels import HEARTBEATS, PLANT_TRUTH
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config

FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
PATIENCE_MS = 30_000
MOST_TRIES = 600
WAIT_S = 0.05


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Bring a lab up with its page; give the page's address and the bus."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    bus = Listener(load_config(overrides=[f"bus.url={os.environ['LCM_DEFAULT_URL']}"]))
    out = tmp_path_factory.mktemp("runs") / "up"
    process = start_klab("up", "--view", "--port", port, "--out", out)
    yield f"http://127.0.0.1:{port}/", bus
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def opened(browser, address, **settings):
    """Open the page as soon as it is served."""
    page = browser.new_context(**settings).new_page()
    page.set_default_timeout(PATIENCE_MS)
    for _ in range(MOST_TRIES):
        with contextlib.suppress(Error):
            page.goto(address)
            return page
        page.wait_for_timeout(WAIT_S * 1e3)
    return pytest.fail("the page is not served")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_everything_in_reach(browser, lab, scheme):
    address, _ = lab
    phone = {"width": 360, "height": 740}
    page = opened(browser, address, viewport=phone, color_scheme=scheme, has_touch=True)
    expect(page.locator("#line")).to_contain_text("R1: ", timeout=PATIENCE_MS)
    expect(page.locator("#stop")).to_be_in_viewport()
    assert page.evaluate("document.documentElement.scrollWidth") <= phone["width"]
    drag = page.locator("#drag")
    before = drag.is_checked()
    drag.press("Enter")
    assert drag.is_checked() is not before
    # Whatever can be pressed has a name and is large enough for a finger.
    for control in page.locator("button:visible").all():
        assert re.search(r"\w", control.inner_text())
        assert control.bounding_box()["height"] >= 44


def test_a_person_watches_sets_a_goal_stops_releases_and_learns_who_died(browser, lab):
    """The last test: it ends the lab."""
    address, bus = lab
    page = opened(browser, address)
    errors = []
    page.on("pageerror", lambda error: errors.append(error))  # playwright marks what it is given
    expect(page.locator("#line")).to_have_text(
        "R1: at rest, nobody commands it", timeout=PATIENCE_MS
    )
    controller = start_klab("run", "controller", "--model", MODEL, "--goal", "1", "0", "0")
    try:
        expect(page.locator("#line")).to_contain_text("parking: driving", timeout=PATIENCE_MS)
        # Drag from the middle of the floor upwards: a goal that looks along x2.
        floor = page.locator("#floor").bounding_box()
        x, y = floor["x"] + floor["width"] / 2, floor["y"] + floor["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 60, steps=3)
        page.mouse.up()
        expect(page.locator("#said")).to_contain_text("confirmed", timeout=PATIENCE_MS)
        expect(page.locator("#facts")).to_contain_text("90.0°", timeout=PATIENCE_MS)
        # The space bar stops, though a field for numbers has the focus.
        page.locator("#x1").focus()
        page.keyboard.press("Space")
        expect(page.locator("#said")).to_have_text("R1: STOP confirmed", timeout=PATIENCE_MS)
        speeds = []
        bus.subscribe(PLANT_TRUTH, lambda truth: speeds.append(abs(truth.v_m_per_s)))
        while bus.spin(0.0):
            pass
        for _ in range(MOST_TRIES):
            bus.spin(WAIT_S)
            if speeds and speeds[-1] < 1e-3:
                break
        assert speeds[-1] < 1e-3
        page.locator("#arm").press("Enter")
        page.locator("#release").press("Enter")
        expect(page.locator("#said")).to_have_text("R1: release confirmed", timeout=PATIENCE_MS)
        page.locator("#stop").click()
        expect(page.locator("#line")).to_contain_text("emergency stop", timeout=PATIENCE_MS)
    finally:
        controller.send_signal(signal.SIGINT)
        controller.communicate(timeout=60)
    pids = []
    bus.subscribe(HEARTBEATS["plant"], lambda beat: pids.append(beat.pid))
    while not pids:
        bus.spin(WAIT_S)
    os.kill(pids[-1], signal.SIGKILL)
    expect(page.locator("#banners")).to_contain_text(
        "plant died (signal SIGKILL)", timeout=PATIENCE_MS
    )
    expect(page.locator("#banners")).to_contain_text("no connection", timeout=PATIENCE_MS)
    assert errors == []
