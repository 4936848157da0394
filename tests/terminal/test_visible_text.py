"""Names and texts of others, shown as they are, whatever they look like."""

import io
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import lcm
import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import environment, klab, klab_ok
from rich.table import Table

from koopman_lab.bus.channels import ONBOARD_STATUS, PROCESS
from koopman_lab.config.load import load_config
from offboard.commands import status as status_command
from offboard.monitor.lab_view import LabView
from offboard.terminal.output import PlainConsole
from offboard.terminal.visible_text import one_line, visible

NASTY = {
    "LEG[/0]": "LEG[/0]",
    "SENSOR[left]": "SENSOR[left]",
    "[bold]A": "[bold]A",
    "[/]": "[/]",
    r"\[x]": r"\[x]",
    "[link=http://x]y[/link]": "[link=http://x]y[/link]",
    "X:smile:": "X:smile:",
    "\x1b[31mRED\x1b[0m": r"\x1b[31mRED\x1b[0m",
    "\x1b]0;title\x07": r"\x1b]0;title\x07",
    "A\tB": r"A\tB",
    "A\rB": r"A\rB",
    "A\x08B": r"A\x08B",
    "C\x9b2J": r"C\x9b2J",
    "\u202eABC": r"\u202eABC",
    "GRÖẞE": "GRÖẞE",
    "数": "数",
}
"""Names, and what a person must see of each."""
table_of_names = pytest.mark.parametrize(("name", "seen"), NASTY.items(), ids=map(repr, NASTY))


@pytest.fixture
def console():
    """Give a console of 200 columns and what it wrote."""
    console = PlainConsole()
    console.file, console.width = io.StringIO(), 200
    return console


@table_of_names
def test_a_text_a_cell_a_header_and_a_title_are_shown_as_they_are(console, name, seen):
    console.print(f"<{name}>")
    table = Table(title=f"<{name}>")
    table.add_column(f"<{name}>")
    table.add_row(f"<{name}>")
    console.print(table)
    shown = console.file.getvalue()
    assert shown.count(f"<{seen}>") == 4
    assert set(shown) - {"\n"} == set(filter(str.isprintable, shown))


@given(st.text())
def test_nothing_but_the_end_of_a_line_moves_the_cursor(text):
    assert visible(text).count("\n") == text.count("\n")
    assert "\n" not in one_line(text)
    assert not {"\x1b", "\r", "\t", "\x9b", "\u202e"} & set(visible(text))
    visible(text).encode()  # half of a pair could not be printed


@given(st.text(st.characters(categories=["L", "N", "P", "S"])))
def test_what_can_be_shown_is_left_alone(text):
    assert visible(text) == one_line(text) == text


BAR = """
import sys
from pathlib import Path
from offboard.terminal.output import progress, status_line
name = sys.argv[1]
with progress(name, name) as report:
    report(1, 2, name)
with status_line() as show:
    show(name)
"""


@table_of_names
def test_the_bar_and_the_line_of_a_terminal_show_it(name, seen):
    ours, theirs = pty.openpty()
    try:
        wide = environment(TERM="xterm", COLUMNS="200")
        subprocess.run([sys.executable, "-c", BAR, name], stderr=theirs, env=wide, check=True)
        shown = os.read(ours, 1 << 16).decode()
    finally:
        os.close(ours)
        os.close(theirs)
    assert shown.count(seen) >= 4
    assert seen == name or name not in shown


def test_a_log_with_such_channels_is_described(tmp_path):
    path = tmp_path / "nasty.lcm"
    log = lcm.EventLog(str(path), "w", overwrite=True)
    names = list(filter(str.isprintable, NASTY))  # others count as damage
    for k, name in enumerate(names):
        log.write_event(k + 1, name, b"x")
    log.close()
    shown = klab_ok("log", "info", path)
    for name in names:
        assert name in shown
    missing = klab("log", "info", path, "--channel", "[/none]")
    assert missing.returncode == 2
    assert "no channel [/none]; there are: " in missing.stderr


def test_a_bus_with_such_channels_is_described(bus_url):
    names = [name for name in NASTY if "\r" not in name]  # LCM's patterns hear no such name
    speaker = subprocess.Popen(
        [sys.executable, "-c", SPEAKER, bus_url, *names], stdin=subprocess.PIPE
    )
    bus, heard = lcm.LCM(bus_url), []
    bus.subscribe(".*", lambda name, _: heard.append(name)).set_queue_capacity(0)
    try:
        while not heard:
            assert bus.handle_timeout(60_000)
        shown = klab_ok("topics", "--once", "--seconds", "1", "--url", bus_url)
    finally:
        speaker.communicate()
    for name in names:
        assert NASTY[name] in shown


SPEAKER = """
import select, sys, lcm
bus = lcm.LCM(sys.argv[1])
while not select.select([sys.stdin], [], [], 0.05)[0]:
    for name in sys.argv[2:]:
        bus.publish(name, b"x")
"""
"""Speaks until its input ends."""


@table_of_names
def test_status_shows_a_robot_of_such_a_name_and_what_a_process_said_last(capsys, name, seen):
    view, now_us = LabView(load_config()), 10_000_000
    died = PROCESS.type()
    died.utime, died.name, died.state = now_us, "plant", died.DIED
    died.ended, died.log_file, died.last_lines = name, name, f"first\n{name}"
    board = ONBOARD_STATUS.type()
    board.utime = now_us
    for channel, message in ((PROCESS, died), (ONBOARD_STATUS, board)):
        view.take(channel.name(name), message.encode(), now_us)
    status_command._show({name: view.robots[name].entries(now_us)})
    shown = capsys.readouterr().out
    assert f"{seen} plant: {seen} ends with:" in shown
    assert "\nfirst\n" in shown
    assert set(shown) - {"\n"} == set(filter(str.isprintable, shown))


def test_nobody_prints_past_it():
    """One console for all, and nobody asks for markup or has to ask for none."""
    root = Path(__file__).parents[2]
    for package in ("offboard", "onboard", "koopman_lab"):
        for file in (root / package).rglob("*.py"):
            if file.name != "output.py":
                text = file.read_text()
                assert not re.search(
                    r"\bConsole\(|rich import print|markup=True|rich\.markup", text
                ), file
