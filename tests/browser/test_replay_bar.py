"""The page's bar steers a log that is sent again."""

import os
import re
import signal
import subprocess

from klab import KLAB, REFERENCE
from playwright.sync_api import expect
from real_bus import other
from viewer.page_server import serving

from offboard.bench.browser import browser, visit

PATIENCE_MS = 60_000


def test_a_person_plays_pauses_scrubs_and_hurries_a_log():
    url = other(os.environ["LCM_DEFAULT_URL"])
    replay = subprocess.Popen(
        [*KLAB, "replay", REFERENCE / "park.lcm", "--paused", "--loop", "--url", url],
        stderr=subprocess.DEVNULL,
    )
    try:
        with serving("--url", url) as (_, address), browser() as chromium:
            page = chromium.new_page()
            page.set_default_timeout(PATIENCE_MS)
            visit(page, address)
            play, bar, time = (page.locator(f"#replay-{what}") for what in ("play", "at", "time"))
            expect(page.locator("#line")).to_have_text(
                "R1: replay: nothing was sent yet", timeout=PATIENCE_MS
            )
            expect(play).to_have_text("Play", timeout=PATIENCE_MS)
            play.press("Enter")
            expect(play).to_have_text("Pause", timeout=PATIENCE_MS)
            expect(page.locator("#replay")).to_be_visible(timeout=PATIENCE_MS)
            play.press("Enter")
            expect(play).to_have_text("Play", timeout=PATIENCE_MS)
            # The arrow keys of a slider, a tenth of a second each; a mouse does the same.
            bar.fill("4")
            expect(time).to_have_text(re.compile(r"^4\.0 of "), timeout=PATIENCE_MS)
            expect(bar).to_have_attribute(
                "aria-valuetext", re.compile(r"^4\.0 of "), timeout=PATIENCE_MS
            )
            # Paused, the page shows that moment: the goal and where the robot was.
            expect(page.locator("#facts")).to_contain_text(
                "goalx1 0.100 m, x2 0.000 m, 20.0", timeout=PATIENCE_MS
            )
            expect(page.locator("#line")).to_contain_text("R1: replay: ", timeout=PATIENCE_MS)
            bar.press("ArrowRight")
            expect(time).to_have_text(re.compile(r"^4\.1 of "), timeout=PATIENCE_MS)
            page.locator("#replay-speed").select_option("4")
            play.press("Enter")
            expect(play).to_have_text("Pause", timeout=PATIENCE_MS)
            expect(time).not_to_have_text(re.compile(r"^4\.1 of "), timeout=PATIENCE_MS)
    finally:
        replay.send_signal(signal.SIGINT)
        replay.wait(timeout=60)
