"""The page in a real browser, with the lab as it runs behind it."""

import os
import re
import shutil
import signal
import socket
import subprocess

import pytest
from browser.patience import PATIENCE_MS
from klab import KLAB, MODEL, REFERENCE, alive, start_klab
from playwright.sync_api import expect
from real_bus import other

from koopman_lab.bus.channels import ESTOP, HEARTBEATS, PROCESS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from offboard.bench.stop_timer import StopTimer

WAIT_S = 0.05
ROBOT = "R2"
"""The log in tests/data/reference is of R1, so that a replay of it may share the bus."""
SECOND = "R3"
TASKS = ("Park", "Calibrate", "Train", "Reference", "Replay")


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Bring a lab up with its page; give the page's address and the bus."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"bus.url={os.environ['LCM_DEFAULT_URL']}"
    bus = Listener(load_config(overrides=[url, f"robot.name={ROBOT}"]))
    folder = tmp_path_factory.mktemp("lab")
    (folder / "runs" / "first").mkdir(parents=True)
    shutil.copy(MODEL, folder / "runs" / "first" / "model.npz")
    up = ("up", "--robot-name", ROBOT, "--view", "--port", port, "--out", "runs/up")
    process = start_klab(*up, cwd=folder)
    yield f"http://127.0.0.1:{port}/", bus
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def release(page, name):
    """Let a stopped robot go, in two steps."""
    page.locator("#arm").press("Enter")
    expect(page.locator("#release")).to_have_text(f"Confirm release of {name}")
    # The second step is offered a moment later.
    expect(page.locator("#release")).to_be_focused()
    page.locator("#release").press("Enter")
    expect(page.locator("#said")).to_contain_text(f"{name}: release confirmed", timeout=PATIENCE_MS)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_everything_in_reach(opened, lab, scheme):
    address, _ = lab
    phone = {"width": 360, "height": 740}
    page = opened(address, viewport=phone, color_scheme=scheme, has_touch=True)
    expect(page.locator("#line")).to_contain_text(f"{ROBOT}: ", timeout=PATIENCE_MS)
    expect(page.locator("#stop")).to_be_in_viewport()
    assert page.evaluate("document.documentElement.scrollWidth") <= phone["width"]
    drag = page.locator("#drag")
    expect(drag).to_be_enabled(timeout=PATIENCE_MS)
    before = drag.is_checked()
    drag.press("Enter")
    assert drag.is_checked() is not before
    # Whatever can be pressed has a name and is large enough for a finger.
    for control in page.locator("button:visible").all():
        assert re.search(r"\w", control.inner_text())
        assert control.bounding_box()["height"] >= 44


def tree(page):
    """Return what a screen reader is given: role, name and properties of every node."""
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    return [
        (
            node["role"]["value"],
            node.get("name", {}).get("value", ""),
            {p["name"]: p["value"].get("value") for p in node.get("properties", ())},
        )
        for node in nodes
        if not node["ignored"]
    ]


def test_keyboard_and_screen_reader_reach_everything(opened, lab):
    address, _ = lab
    page = opened(address)
    expect(page.locator("#processes tbody tr").first).to_be_visible(timeout=PATIENCE_MS)
    expect(page.locator("#start-model")).to_contain_text("first/model.npz", timeout=PATIENCE_MS)
    nodes = tree(page)
    reached = {
        (role, name) for role, name, kept in nodes if kept.get("focusable") and role != "option"
    }
    # Neither a release of a robot that is not stopped, nor a goal that no controller takes.
    controls = {
        *{("radio", name) for name in (ROBOT, *TASKS)},
        *{("button", name) for name in ("STOP every robot · space bar", "Start: park")},
        ("checkbox", "Drag on the floor to set it"),
        *{("spinbutton", name) for name in ("x1 (m)", "x2 (m)", "heading (°)", "Seed")},
        *{("combobox", name) for name in ("Robot", "Model", "Cost", "Time axis")},
        ("DisclosureTriangle", "What each needs, and who may stop it"),
        *{("region", name) for name in ("Queue and history", "Processes", "Channels")},
    }
    assert reached == controls | {("RootWebArea", page.title())}
    assert page.title() == f"{ROBOT}: at rest · klab view"
    assert re.fullmatch(r"\d processes alive, .* lost", page.locator("#health").inner_text())
    names = {role: {name for kind, name, _ in nodes if kind == role} for role, _, _ in nodes}
    assert "The lab, seen by klab view" in names["heading"]
    assert names["table"] == {"Processes", "Channels"}  # a third one is folded
    assert {"process", "state", "channel", "lost"} <= names["columnheader"]
    assert {"plant", f"{ROBOT}_MOCAP_POSE"} <= names["rowheader"]
    assert "" not in names["figure"] | names["form"] | names["button"]
    (picture,) = names["image"]
    assert re.search(rf"{ROBOT} at x1 -?\d.*m, .*°; goal none", picture)
    # What changes is said: the line when there is time, a warning and an answer at once.
    live = [kept["live"] for _, _, kept in nodes if "live" in kept]
    assert sorted(live) == ["assertive", "assertive", "polite", "polite"]
    # The keyboard comes to each of them, in the order of the page, and one sees where it is.
    there = [
        *("radio", "stop", "x1", "x2", "theta", "drag", "radio"),
        *(
            "start-robot",
            "start-model",
            "start-cost",
            "start-seed",
            "begin",
            "runs-section",
            "span",
        ),
        *("Processes", "What", "channels-section"),
    ]
    order = []
    for _ in there:
        page.keyboard.press("Tab")
        order.append(
            page.evaluate(
                "() => { const e = document.activeElement, s = getComputedStyle(e);"
                " return [e.id || e.type || e.textContent.trim().split(/\\s/)[0],"
                " s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) >= 2]; }"
            )
        )
    assert [name for name, _ in order] == there
    assert all(seen for _, seen in order)
    page.keyboard.press("Space")
    expect(page.locator("#word")).to_have_text("stopped", timeout=PATIENCE_MS)
    page.locator("#arm").press("Enter")
    expect(page.locator("#release")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator("#arm")).to_be_focused()
    release(page, ROBOT)


def test_a_replay_beside_a_robot_is_marked_and_cannot_be_steered(opened, lab):
    address, bus = lab
    page = opened(address)
    url = ("--url", os.environ["LCM_DEFAULT_URL"])
    replay = subprocess.Popen(
        [*KLAB, "replay", REFERENCE / "park.lcm", *url], stderr=subprocess.DEVNULL
    )
    try:
        log = page.locator("input[value=R1]")
        log.check(timeout=PATIENCE_MS)
        expect(page.locator("#replay")).to_be_visible(timeout=PATIENCE_MS)
        expect(page.locator("#line")).to_contain_text("R1: replay: ")
        for control in ("#drag", "#x1", "#arm", "#goal button"):
            expect(page.locator(control)).to_be_disabled()
        stops = []
        bus.subscribe(ESTOP, stops.append)
        page.keyboard.press("Space")
        expect(page.locator("#said")).to_contain_text(
            f"{ROBOT}: STOP confirmed", timeout=PATIENCE_MS
        )
        while bus.spin(0.0):
            pass
        assert stops
        page.locator(f"input[value={ROBOT}]").check()
        expect(page.locator("#replay")).to_be_hidden()
        expect(page.locator("#line")).to_contain_text(f"{ROBOT}: stopped: emergency stop")
    finally:
        replay.send_signal(signal.SIGINT)
        replay.wait(timeout=60)
    # A double click is one gesture, not two steps.
    page.locator("#arm").dblclick()
    expect(page.locator("#release")).to_be_enabled()
    page.keyboard.press("Escape")
    expect(page.locator("#said")).to_contain_text(f"{ROBOT}: not released")
    expect(page.locator("#line")).to_contain_text(f"{ROBOT}: stopped: emergency stop")
    release(page, ROBOT)


@pytest.fixture
def second(tmp_path):
    """Bring another robot up beside the first."""
    process = start_klab("up", "--robot-name", SECOND, "--out", tmp_path / "up")
    yield SECOND
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def test_two_robots_stop_together_and_are_released_one_by_one(opened, lab, second):
    address, _ = lab
    page = opened(address)
    line, said = page.locator("#line"), page.locator("#said")

    def choose(name):
        page.locator(f"input[value={name}]").check(timeout=PATIENCE_MS)

    for name in (second, ROBOT):
        choose(name)
        expect(line).to_contain_text(f"{name}: at rest, nobody commands it", timeout=PATIENCE_MS)
        expect(page.locator("#channels")).to_contain_text(f"{name}_MOCAP_POSE")
    page.keyboard.press("Space")
    # Each robot's answer has a line of its own.
    for name in (second, ROBOT):
        expect(said).to_contain_text(f"{name}: STOP confirmed", timeout=PATIENCE_MS)
    for name in (second, ROBOT):
        choose(name)
        expect(line).to_contain_text(f"{name}: stopped: emergency stop", timeout=PATIENCE_MS)
    choose(second)
    release(page, second)
    expect(line).to_contain_text(f"{second}: at rest, nobody commands it", timeout=PATIENCE_MS)
    choose(ROBOT)
    expect(line).to_contain_text(f"{ROBOT}: stopped: emergency stop", timeout=PATIENCE_MS)
    release(page, ROBOT)


def test_a_person_watches_sets_a_goal_stops_releases_and_learns_who_died(opened, lab):
    """The last test: it ends the lab."""
    address, bus = lab
    page = opened(address)
    errors = []
    page.on("pageerror", lambda error: errors.append(error))  # playwright marks what it is given
    expect(page.locator("#line")).to_have_text(
        f"{ROBOT}: at rest, nobody commands it", timeout=PATIENCE_MS
    )
    page.evaluate(
        "() => { for (const kind of ['keydown', 'click']) addEventListener(kind,"
        " () => { window.pressed = Date.now(); }, { capture: true }); }"
    )
    wheels = StopTimer(bus)
    # At the goal it stays, however long the browser takes to send the robot somewhere else.
    stays = ("--set", "controller.parked_hold_s=1000", "--set", "controller.time_limit_s=1000")
    park = ("run", "controller", "--robot-name", ROBOT, "--model", MODEL, *stays, "--goal")
    controller = start_klab(*park, "1", "0", "0")
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
        expect(page.locator("#floor")).to_have_attribute(
            "aria-label", re.compile(r"goal .*; distance \d\.\d\d m"), timeout=PATIENCE_MS
        )
        # Drag leaves the numbers in the fields; the keyboard alone sets the next goal.
        page.locator("#x1").fill("1.5")
        page.locator("#x1").press("Enter")
        expect(page.locator("#facts")).to_contain_text("1.500 m", timeout=PATIENCE_MS)
        # The space bar stops, though a field for numbers has the focus.
        wheels.turn()
        page.keyboard.press("Space")
        by_key = wheels.stop_after(page.evaluate("window.pressed") * 1000)
        expect(page.locator("#said")).to_contain_text(
            f"{ROBOT}: STOP confirmed", timeout=PATIENCE_MS
        )
        release(page, ROBOT)
    finally:
        controller.send_signal(signal.SIGINT)
        controller.communicate(timeout=60)
    controller = start_klab(*park, "-1", "0", "0")
    try:
        wheels.turn()
        page.locator("#stop").click()
        by_button = wheels.stop_after(page.evaluate("window.pressed") * 1000)
        expect(page.locator("#line")).to_contain_text("emergency stop", timeout=PATIENCE_MS)
    finally:
        controller.send_signal(signal.SIGINT)
        controller.communicate(timeout=60)
    for zero_us, stood_us in (by_key, by_button):
        # In order; how soon, `klab bench stop` and tests/onboard/test_emergency_stop.py show.
        assert 0 <= zero_us <= stood_us
    told = []
    bus.subscribe(PROCESS, told.append)
    while not (views := [process for process in told if process.name == "view"]):
        bus.spin(WAIT_S)
    server, supervisors = [views[-1].pid], [views[-1].supervisor_pid]
    os.kill(server[-1], signal.SIGSTOP)
    page.keyboard.press("Space")
    expect(page.locator("#said")).to_contain_text("STOP NOT CONFIRMED", timeout=PATIENCE_MS)
    expect(page.locator("body")).to_have_class("lost", timeout=PATIENCE_MS)
    os.kill(server[-1], signal.SIGCONT)
    expect(page.locator("#said")).to_contain_text(f"{ROBOT}: STOP confirmed", timeout=PATIENCE_MS)
    pids = []
    bus.subscribe(HEARTBEATS["plant"], lambda beat: pids.append(beat.pid))
    while not pids:
        bus.spin(WAIT_S)
    os.kill(pids[-1], signal.SIGSTOP)
    expect(page.locator("#banners")).to_contain_text(
        re.compile(rf"stale for \d+ s, from the plant: .*{ROBOT}_MOCAP_POSE"), timeout=PATIENCE_MS
    )
    expect(page.locator("#warned")).to_contain_text("from the plant")
    os.kill(pids[-1], signal.SIGKILL)
    expect(page.locator("#banners")).to_contain_text(
        "plant died (signal SIGKILL)", timeout=PATIENCE_MS
    )
    expect(page.locator("#last-words")).to_contain_text("plant.log ends with")
    # The page stays, and so does nothing that could be pressed in vain.
    expect(page.locator("#word")).to_have_text("gone", timeout=PATIENCE_MS)
    expect(page.locator("#stop")).to_have_class("dead")
    expect(page.locator("#stop")).to_contain_text("no robot is heard")
    for control in ("#arm", "#goal button"):
        expect(page.locator(control)).to_be_disabled()
    expect(page.locator("body")).not_to_have_class("lost")
    os.kill(supervisors[-1], signal.SIGINT)
    expect(page.locator("#banners")).to_contain_text("no connection", timeout=PATIENCE_MS)
    expect(page.locator("body")).to_have_class("lost")
    expect(page.locator("#stop")).to_contain_text("no connection")
    # It closes its connections before it leaves its port to the next.
    for _ in range(round(PATIENCE_MS * 1e-3 / WAIT_S)):
        if not alive(server[-1]):
            break
        bus.spin(WAIT_S)
    # A page that finds its server again shows nothing of a lab that is there no more.
    port = address.rstrip("/").rpartition(":")[2]
    viewer = start_klab("view", "--port", port, "--url", other(os.environ["LCM_DEFAULT_URL"]))
    try:
        expect(page.locator("#line")).to_have_text("no robot is heard", timeout=PATIENCE_MS)
        expect(page.locator("#banners")).to_be_hidden()
        expect(page.locator("#processes tbody tr")).to_have_count(0)
        for control in ("#arm", "#goal button"):
            expect(page.locator(control)).to_be_disabled()
    finally:
        viewer.send_signal(signal.SIGINT)
        viewer.communicate(timeout=60)
    assert errors == []
