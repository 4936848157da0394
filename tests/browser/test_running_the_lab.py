"""The page runs the lab: what it starts, what it offers, and whether everybody can read it."""

import re
import shutil
import signal
import socket

import pytest
from axe_playwright_python.sync_playwright import Axe
from browser.patience import PATIENCE_MS
from klab import MODEL, start_klab
from playwright.sync_api import expect
from viewer.page_server import serving

DESK, PHONE = {"width": 1366, "height": 768}, {"width": 360, "height": 740}
SCREENS = [(DESK, "light"), (DESK, "dark"), (PHONE, "light"), (PHONE, "dark")]
DRIVE_MS = 120_000
MOST_TRIES = 50


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Give a folder with a model in its runs."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "runs" / "first").mkdir(parents=True)
    shutil.copy(MODEL, folder / "runs" / "first" / "model.npz")
    return folder


def require_readable(page):
    """Fail with what axe finds wrong, of contrast, names, roles and the rest."""
    results = Axe().run(page)
    assert results.response["passes"]
    assert results.violations_count == 0, results.generate_report()


def require_no_scrolling(page):
    """Fail where something of the state of the lab is out of sight."""
    window = page.viewport_size
    assert page.evaluate("document.documentElement.scrollHeight") <= window["height"]
    for table in ("#facts", "#processes", "#channels", "#floor", "#plots", "#begin", "#stop"):
        box = page.locator(table).bounding_box()
        assert box["y"] >= 0, table
        assert box["y"] + box["height"] <= window["height"], (table, box)


def begin(page):
    """Start it; again where a busy machine's picture was too old for that."""
    said = page.locator("#said")
    for _ in range(MOST_TRIES):
        expect(page.locator("#begin")).to_be_enabled(timeout=PATIENCE_MS)
        page.locator("#begin").press("Enter")
        expect(said).to_contain_text(re.compile("starting|not done"), timeout=PATIENCE_MS)
        if "starting" in said.inner_text():
            return
    pytest.fail("never started")


def test_a_robot_is_parked_from_the_page_and_what_it_came_to_is_kept(opened, folder):
    with serving(cwd=folder) as (_, address):
        page = opened(address, viewport=DESK)
        word, first = page.locator("#word"), page.locator("#runs li").first
        expect(page.locator("#line")).to_have_text("no robot is heard", timeout=PATIENCE_MS)
        # Nobody is there to be stopped, let go, or sent anywhere; nothing is there to train with.
        expect(page.locator("#stop")).to_have_class("dead")
        for control in ("#arm", "#goal button"):
            expect(page.locator(control)).to_be_disabled()
        page.locator("input[value=train]").check()
        expect(page.locator("#begin")).to_be_disabled()
        expect(page.locator("#start-note")).to_contain_text("calibrate first")
        page.locator("input[value=park]").check()
        page.locator("#x1").fill("0.2")
        page.locator("#theta").fill("30")
        page.locator("#start-cost").select_option("me")
        page.locator("#start-seed").fill("3")
        begin(page)
        expect(word).to_have_text("parking", timeout=DRIVE_MS)
        expect(word).to_have_attribute("data-tone", "active")
        expect(page.locator("#stop")).not_to_have_class("dead")
        expect(page.locator("#goal button")).to_be_enabled()
        expect(page.locator("#processes")).to_contain_text("controller")
        require_no_scrolling(page)
        expect(first.locator(".chip")).to_have_text("parked", timeout=DRIVE_MS)
        expect(page.locator("#ran")).to_contain_text("park: parked.")
        for text in ("from the goal", "model first/model.npz", "cost mixed exponents", "seed 3"):
            expect(first).to_contain_text(text)
        run = re.search(r"folder (\S+)", first.inner_text()).group(1)
        assert (folder / "runs" / run / "summary.json").exists()
        # The axis fits the drive, and the words say what the plots show.
        words = page.locator("#plots figure p").first.inner_text()
        seconds = int(re.match(r"Over (\d+) s\. measured: from .* m/s", words).group(1))
        assert 2 <= seconds <= 30
    # Another page, later: the history is read from the disk, with what the run used.
    with serving(cwd=folder) as (_, address):
        page = opened(address, viewport=DESK)
        first = page.locator("#runs li").first
        expect(first.locator(".chip")).to_have_text("parked", timeout=PATIENCE_MS)
        for text in ("kind kinematic", "model first/model.npz", "cost me", "seed 3", run):
            expect(first).to_contain_text(text)


@pytest.fixture(scope="module")
def standing(folder):
    """Serve the page beside a lab that stands."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    up = ("up", "--view", "--port", port, "--robot-name", "R4", "--out", "runs/up")
    process = start_klab(*up, cwd=folder)
    yield f"http://127.0.0.1:{port}/"
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


@pytest.mark.parametrize(("screen", "scheme"), SCREENS)
def test_everybody_can_read_the_page_on_every_screen(opened, standing, screen, scheme):
    page = opened(standing, viewport=screen, color_scheme=scheme, has_touch=screen is PHONE)
    word = page.locator("#word")
    expect(word).to_have_text("idle", timeout=PATIENCE_MS)
    expect(page.locator("#channels tbody tr").nth(9)).to_be_attached(timeout=PATIENCE_MS)
    assert page.evaluate("document.documentElement.scrollWidth") <= screen["width"]
    expect(page.locator("#stop")).to_be_in_viewport(ratio=1)
    if screen is DESK:
        require_no_scrolling(page)
    else:
        for control in page.locator(":is(button, select, input[type=number]):visible").all():
            assert control.bounding_box()["height"] >= 44
    require_readable(page)
    page.keyboard.press("Space")
    expect(word).to_have_text("stopped", timeout=PATIENCE_MS)
    expect(word).to_have_attribute("data-tone", "bad")
    expect(page.locator("#start-note")).to_have_text("R4 is stopped: release it first")
    expect(page.locator("#begin")).to_be_disabled()
    require_readable(page)
    page.locator("#arm").press("Enter")
    expect(page.locator("#release")).to_be_focused()
    page.locator("#release").press("Enter")
    expect(word).to_have_text("idle", timeout=PATIENCE_MS)


@pytest.mark.usefixtures("standing")
def test_a_watchers_page_offers_nothing_and_says_so(opened, folder):
    with serving("--host", "0.0.0.0", cwd=folder) as (process, _):
        watching = re.search(r"watch only: http://[^:]+(\S+)", process.stderr.readline()).group(1)
        page = opened(f"http://127.0.0.1{watching}", viewport=DESK)
        expect(page.locator("#word")).to_have_text("idle", timeout=PATIENCE_MS)
        expect(page.locator("#stop")).to_have_class("dead")
        expect(page.locator("#stop")).to_contain_text("this address only watches")
        for control in ("#arm", "#goal button", "#x1", "#drag", "#begin"):
            expect(page.locator(control)).to_be_disabled()
        page.keyboard.press("Space")
        expect(page.locator("#said")).to_contain_text("this address only watches")
        require_readable(page)
