"""Ctrl-C at random moments, and outputs that nobody takes: words, the right code, no traceback."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from klab import MODEL, REFERENCE, SMALL_AREA

from offboard.terminal.exit_codes import ExitCode

KLAB = [sys.executable, "-m", "offboard.cli.start"]
"""As the installed command begins: Ctrl-C counts from the first moment of its own."""
LOG = str(REFERENCE / "calibration.lcm")
STARTED_S = 0.2
"""After so long the interpreter itself has begun, which says what it likes."""
INTERRUPTED = (ExitCode.INTERRUPTED, -signal.SIGINT)
"""A shell calls both 130. Python ends by the signal itself where it came in code made of a text, as
that of every named tuple."""
LIMIT_S = 60.0
COMMANDS = {
    "help": ("--help",),
    "info": ("log", "info", LOG),
    "simulation": ("simulate", "--duration", "5", "--out", "{out}/run"),
    "calibration": ("calibrate", "--lockstep", "--out", "{out}/run"),
    "parking": ("park", "--lockstep", "--model", str(MODEL), "--out", "{out}/run"),
    "topics": ("topics",),
    "session": ("calibrate", *SMALL_AREA, "--out", "{out}/run"),
    "study": (
        *("study", "kinematic-parking", "--model", str(MODEL), "--runs", "3", "--workers", "2"),
        *("--chunk", "1", "--set", "controller.horizon=10", "--out", "{out}/study"),
    ),
}
LASTS_S = {"help": 0.4, "info": 1.0}
"""How long a command takes; the others some seconds."""
WITHOUT_END = ("topics",)
"""What Ctrl-C ends as it should, without a word."""


def interrupted(command, out, after_s):
    """Press Ctrl-C in a terminal of the command: all of its processes get it."""
    process = subprocess.Popen(
        [*KLAB, *(word.format(out=out) for word in command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=out,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        process.wait(timeout=after_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=LIMIT_S)
    return process.returncode, said


@pytest.mark.parametrize("what", COMMANDS)
def test_ctrl_c_ends_every_command_in_words_whenever_it_comes(what, tmp_path):
    moments = random.Random(what)
    for number in range(2):
        out = tmp_path / str(number)
        out.mkdir()
        after_s = STARTED_S + moments.uniform(0.0, LASTS_S.get(what, 3.0))
        code, said = interrupted(COMMANDS[what], out, after_s)
        assert code in (ExitCode.DONE, *INTERRUPTED), f"after {after_s:.3f} s:\n{said}"
        assert "Traceback" not in said, f"after {after_s:.3f} s:\n{said}"
        if code and what not in WITHOUT_END:
            assert "interrupted" in said
        # What a writer had not finished is hidden, and gone.
        assert not [file for file in out.rglob(".*") if file.is_file()]


def test_an_interrupted_study_says_how_it_goes_on_and_does(tmp_path):
    folder = tmp_path / "study"
    command = [*KLAB, *(word.format(out=tmp_path) for word in COMMANDS["study"])]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    rows = folder / "rows.jsonl"
    end_s = time.monotonic() + LIMIT_S
    while not (rows.exists() and rows.read_bytes()):
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end_s
        time.sleep(0.05)  # that a file grows is told to nobody
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=LIMIT_S)
    assert process.returncode in INTERRUPTED, said
    assert f"interrupted; what is done is kept: the same command with --resume --out {folder}" in (
        said.replace("\n", " ")
    )
    assert "Traceback" not in said
    kept = rows.read_bytes()
    done = subprocess.run([*command, "--resume"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert rows.read_bytes().startswith(kept)


FULL = Path("/dev/full")
SPOKEN = {
    "help": ("--help",),
    "version": ("--version",),
    "help of a command": ("park", "--help"),
    "configuration": ("config", "show"),
    "keys as JSON": ("config", "keys", "--json"),
    "log as JSON": ("log", "info", LOG, "--json"),
}


@pytest.mark.parametrize("what", SPOKEN)
def test_a_full_disk_behind_the_output_is_said(what):
    with FULL.open("w") as full:
        done = subprocess.run(
            [*KLAB, *SPOKEN[what]], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    said = " ".join(done.stderr.split())
    assert done.returncode == ExitCode.LAB_FAILURE, said
    assert "cannot be written (No space left on device); make room on the disk" in said
    assert "Traceback" not in said
    assert "Exception ignored" not in said
    assert said.count("klab: ") == 1


def test_a_full_disk_behind_the_messages_leaves_the_code():
    with FULL.open("w") as full:
        done = subprocess.run([*KLAB, "train", "none.lcm"], stderr=full, check=False)
    assert done.returncode == ExitCode.MISUSE


def test_whoever_reads_only_the_beginning_gets_that():
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*KLAB, "config", "keys"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writer)
    assert done.returncode == ExitCode.UNREAD
    assert done.stderr == ""


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_an_output_that_is_closed_is_no_fault(closed):
    line = f'exec "$@" {closed}'
    command = ["bash", "-c", line, "klab", *KLAB, "config", "show"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == ExitCode.DONE
    assert "Traceback" not in done.stderr
