"""Which robots the page's state keeps, when more names speak than it has places for."""

import tracemalloc

from test_state import speak

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.config.load import dump_config, load_config
from offboard.monitor.lab_view import LabView

LETTERS = "abcdefgh", "bcdefghi"


def test_a_robot_that_fell_silent_gives_its_place_to_one_that_speaks():
    view = LabView(load_config())
    for now_us in range(0, 2_000_000, 100_000):
        for k in range(16):
            speak(view, f"GHOST{k}", now_us)
    speak(view, "GHOST3", 9_000_000)
    speak(view, "R1", 10_000_000)
    notes = [robot["banners"][-1] for robot in view.snapshot(10_000_000).values()]
    assert len(notes) == 16
    assert {"klab estop --robot-name R1" in note for note in notes} == {True}
    speak(view, "R1", 12_000_000)
    speak(view, "GHOST3", 12_000_000)
    shown = view.snapshot(13_500_000)
    assert {"R1", "GHOST3"} < shown.keys()
    assert len(shown) == 16
    assert not any("klab estop" in note for robot in shown.values() for note in robot["banners"])


def test_names_that_fell_silent_leave_room_for_a_robots_channels():
    view = LabView(load_config())
    for k in range(600):
        view.take(f"GHOST{k}", b"", 0)
    speak(view, "R1", 0)
    assert view.snapshot(0) == {}
    speak(view, "R1", 11_000_000)
    assert view.snapshot(11_000_000)["R1"]["banners"] == []


def test_who_is_only_spoken_to_is_no_robot():
    view = LabView(load_config())
    for channel in (channels.ESTOP, channels.GOAL, channels.FAULT, channels.PLANT_RESET):
        speak(view, "R9", 0, channel)
    assert view.snapshot(0) == {}


def test_size_and_sets_are_marked_as_assumed_until_a_session_says_them():
    view = LabView(load_config())
    speak(view, "R1", 0)
    robot = view.snapshot(0)["R1"]
    assert robot["assumed"]
    assert robot["line"].endswith("; size and sets as this viewer assumes")
    info = lcmtypes.session_info_t()
    info.config_yaml = dump_config(load_config(overrides=["robot.track_width_m=0.5"]))
    view.take("R1_SESSION_INFO", info.encode(), 600_000)
    robot = view.snapshot(600_000)["R1"]
    assert not robot["assumed"]
    assert "assumes" not in robot["line"]
    assert robot["robot"]["track_width_m"] == 0.5
    # The page of a lab knows its own robot.
    view = LabView(load_config(), known_robot="R1")
    for name in ("R1", "R2"):
        speak(view, name, 0)
    assert {name: robot["assumed"] for name, robot in view.snapshot(0).items()} == {
        **{"R1": False, "R2": True},
    }


def test_a_configuration_that_is_a_bomb_costs_the_page_nothing():
    """Anybody may send SESSION_INFO; what follows shall not wait for it."""
    view = LabView(load_config())
    speak(view, "R1", 0)
    info = lcmtypes.session_info_t()
    bombs = [
        "a: &a [x,x,x,x,x,x,x,x,x]\n"
        + "".join(
            f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n" for a, b in zip(*LETTERS, strict=True)
        ),
        "a: &a\n  b: *a\n",
        "a: " + "[" * 200_000,
        "#" * 1_000_000,
        "seed: 1\nseed: 2\n",
        "robot: {kind: unicycle}\n",
    ]
    tracemalloc.start()
    for k, info.config_yaml in enumerate(bombs, start=1):
        data = info.encode()
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        view.take("R1_SESSION_INFO", data, k * 1_000_000)
        assert tracemalloc.get_traced_memory()[1] - before < 100_000 + 10 * len(data)
        robot = view.snapshot(k * 1_000_000)["R1"]
        assert robot["assumed"]
        assert any("none of this version" in banner for banner in robot["banners"])
    tracemalloc.stop()


def test_who_invents_configurations_endlessly_has_few_of_them_read():
    view = LabView(load_config())
    info = lcmtypes.session_info_t()
    widths = set()
    for k in range(100):
        info.config_yaml = dump_config(
            load_config(overrides=[f"robot.track_width_m={1 + k / 100}"])
        )
        view.take("R1_SESSION_INFO", info.encode(), k * 10_000)
        widths.add(view.robots["R1"].config.robot.track_width_m)
    assert len(widths) == 2
