"""Names and texts of strangers on a real bus and in real logs, shown by every command that can.

Whatever they hold, a command writes characters that show and ends of lines, and no traceback.
"""

import io
import json
import os
import subprocess
import sys
import unicodedata

import lcm
import pytest
from klab import MODEL, klab
from rich.console import Group
from rich.live import Live
from rich.panel import Panel
from rich.text import Text
from rich.tree import Tree

from koopman_lab.bus.channels import MOCAP_POSE, ONBOARD_STATUS, PROCESS, SESSION_INFO
from koopman_lab.errors import LabError
from offboard.cli import main as cli
from offboard.terminal.exit_codes import ExitCode
from offboard.terminal.output import PlainConsole
from offboard.terminal.visible_text import OBEYED, visible_json

HOSTILE = (
    *(
        "\x1b[31mRED\x1b[0m",
        "\x1b]0;title\x07",
        "\x1b]52;c;ZWNobw==\x07",
        "\x1bP+q\x1b\\",
        "\x1b[2J",
    ),
    *(
        "\x9b2J",
        "\x9d0;t\x9c",
        "\x7f\x08\x08",
        "A\rB",
        "A\tB",
        "A\nFORGED: all is well",
        "A\x0bB\x0cC",
    ),
    *("\u202eevil\u202c", "\u2066x\u2069", "\u200b\u200d\ufeff", "\u2028x\u2029", "\U000e0041"),
    *("[bold]x[/bold]", "[/]", "[link=http://x]y[/link]", "[red on blue]", r"\[x]", ":smile:"),
)


def shown_safely(text):
    """Return whether nothing in a text but ends of lines is obeyed by a terminal."""
    return all(c == "\n" or unicodedata.category(c) not in OBEYED for c in text)


def messages(now_us):
    """Give channels and messages in which every text that may be hostile is."""
    for text in HOSTILE:
        yield text, b"x"
        yield f"{text}_MOCAP_POSE", b"no pose"
        for channel, fields in (
            (MOCAP_POSE, {}),
            (ONBOARD_STATUS, {}),
            (SESSION_INFO, {"config_yaml": f"robot: {{name: '{text}'}}"}),
            (
                PROCESS,
                {"name": text, "ended": text, "log_file": text, "last_lines": f"{text}\n{text}"},
            ),
        ):
            message = channel.type()
            message.utime = now_us
            for name, value in fields.items():
                if hasattr(message, name):
                    setattr(message, name, value)
            if channel is PROCESS:
                message.state = message.DIED
            yield channel.name(text), message.encode()


@pytest.fixture(scope="module")
def hostile_log(tmp_path_factory):
    path = tmp_path_factory.mktemp("hostile") / "session.lcm"
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for number, (channel, data) in enumerate(messages(1_700_000_000_000_000)):
        log.write_event(1_700_000_000_000_000 + 1000 * number, channel, data)
    log.close()
    return path


LOG_COMMANDS = (
    *(("log", "info", "{log}"), ("log", "info", "{log}", "--salvage")),
    *(
        ("log", "info", "{log}", "--salvage", "--json"),
        ("log", "export", "{log}", "--out", "{out}"),
    ),
    *(("log", "export", "{log}", "--salvage", "--out", "{out}"), ("dataset", "make", "{log}")),
    *(
        ("dataset", "info", "{log}", "--salvage"),
        ("train", "{log}"),
        ("train", "{log}", "--salvage"),
    ),
    *(("validate", "{log}", "--model", "{log}"), ("rerun", "{log}", "--node", "sampler")),
    *(("figure", "session", "{log}"), ("model", "info", "{log}"), ("log", "info", "{hostile}.lcm")),
)


def checked(done):
    assert shown_safely(done.stdout), repr(done.stdout)
    assert shown_safely(done.stderr), repr(done.stderr)
    assert "Traceback" not in done.stderr
    return done


@pytest.mark.parametrize("command", LOG_COMMANDS, ids=" ".join)
def test_a_log_of_strangers_is_shown_and_not_obeyed(hostile_log, tmp_path, command):
    places = {"log": hostile_log, "out": tmp_path / "out", "hostile": tmp_path / HOSTILE[0]}
    done = checked(klab(*(word.format(**places) for word in command), cwd=tmp_path))
    if "--json" in command and done.returncode == 0:
        json.loads(done.stdout)


SPEAKER = """
import select, sys, lcm
sys.path[:0] = sys.argv[2:]
from time import time_ns
from terminal.test_hostile_names import messages
bus = lcm.LCM(sys.argv[1])
while not select.select([sys.stdin], [], [], 0.05)[0]:
    for channel, data in messages(time_ns() // 1000):
        bus.publish(channel, data)
"""
"""Speaks until its input ends."""


@pytest.fixture(scope="module")
def hostile_bus():
    bus_url = os.environ["LCM_DEFAULT_URL"]
    speaker = subprocess.Popen(
        [sys.executable, "-c", SPEAKER, bus_url, *sys.path], stdin=subprocess.PIPE
    )
    bus, heard = lcm.LCM(bus_url), []
    bus.subscribe(".*", lambda name, _: heard.append(name)).set_queue_capacity(0)
    while not heard:
        assert bus.handle_timeout(60_000)
    yield bus_url
    speaker.communicate()


BUS_COMMANDS = (
    *(("topics", "--once", "--seconds", "1"), ("topics", "--once", "--seconds", "1", "--json")),
    *(("status",), ("status", "--json"), ("doctor",), ("goal", "0", "0", "0")),
    ("estop", "--limit-s", "2"),
    ("park", "--model", str(MODEL), "--start", "0.05", "0", "0"),
)


@pytest.mark.parametrize("command", BUS_COMMANDS, ids=" ".join)
def test_a_bus_of_strangers_is_shown_and_not_obeyed(hostile_bus, tmp_path, command):
    done = checked(klab(*command, "--url", hostile_bus, cwd=tmp_path))
    if "--json" in command:
        json.loads(done.stdout)


@pytest.mark.parametrize("text", HOSTILE, ids=repr)
def test_whatever_is_printed_comes_past_one_place(text):
    """Also what is no plain text any more: styled texts, trees, live displays."""
    console = PlainConsole()
    console.file, console.width = io.StringIO(), 200
    tree = Tree(Text(text))
    tree.add(text)
    with Live(console=console, auto_refresh=False) as live:
        live.update(Group(Text(text), tree, Panel(Text(text), title=Text(text))), refresh=True)
    console.print(Text(text, style="bold"), text, {"key": text})
    console.log(text)
    console.rule(text)
    console.print_json(json.dumps({text: [text]}))
    assert shown_safely(console.file.getvalue())


@pytest.mark.parametrize("text", HOSTILE, ids=repr)
def test_json_says_the_same_value(text):
    console = PlainConsole()
    console.file = io.StringIO()
    console.print_json(json.dumps({text: [text]}))
    assert json.loads(console.file.getvalue()) == {text: [text]}
    assert json.loads(visible_json(json.dumps(text, ensure_ascii=False))) == text


@pytest.mark.parametrize("text", HOSTILE, ids=repr)
def test_errors_show_the_names_they_speak_of(text, capsys, monkeypatch):
    """An expected mistake, and one that nobody expected."""

    def fail(error):
        raise error

    codes = []
    for error in (LabError(f"robot {text}"), ValueError(text)):
        monkeypatch.setattr(cli, "command_line", lambda error=error: lambda **_: fail(error))
        with pytest.raises(SystemExit) as ended:
            cli.main()
        codes.append(ended.value.code)
    assert codes == [ExitCode.MISUSE, ExitCode.CRASH]
    said = capsys.readouterr().err
    assert shown_safely(said)
    assert "klab: robot " in said
    assert "ValueError: " in said
