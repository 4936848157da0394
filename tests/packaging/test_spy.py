"""`scripts/spy`: what it builds, what it calls, and what it says where something is missing.

The scripts run in a copy of their folder, beside a virtual environment that stands ready.
"""

import os
import shutil
import subprocess
from pathlib import Path

import lcm
import pytest
from checkout import ROOT, checkout

TOOLS = ("bash", "cat", "cksum", "find", "mktemp", "mv", "mkdir", "rm", "dirname")
"""Of the system, besides Java and Python, that the script calls."""


@pytest.fixture
def place(tmp_path):
    """Copy what the script reads; Python and the tools are there, Java is not."""
    programs = checkout(tmp_path)
    for tool in TOOLS:
        (programs / tool).symlink_to(shutil.which(tool))
    return tmp_path


def spy(place, *arguments, **variables):
    path = str(place / ".venv" / "bin")
    return subprocess.run(
        ["bash", place / "scripts" / "spy", *arguments],
        env={"PATH": path, "HOME": os.environ.get("HOME", "/")} | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def add(place, name, script):
    """Put a program on the path that notes how it is called."""
    file = place / ".venv" / "bin" / name
    file.write_text(f'#!/bin/sh\necho "{name} $CLASSPATH $*" >> {place}/calls\n{script}\n')
    file.chmod(0o755)


@pytest.mark.parametrize("missing", ["java", "javac", "jar"])
def test_without_java_it_says_so_and_what_shows_the_same(place, missing):
    for name in {"java", "javac", "jar"} - {missing}:
        add(place, name, "exit 1")
    done = spy(place)
    assert done.returncode == 2
    assert f"{missing} is missing" in done.stderr
    assert "apt install default-jdk" in done.stderr
    assert "klab topics" in done.stderr


def test_with_java_it_compiles_every_type_once_and_opens_the_spy_on_the_bus(place):
    add(place, "javac", 'while [ "$1" != -d ]; do shift; done; echo "$@" > "$2/compiled"')
    add(place, "jar", 'cat "$4/compiled" > "$2"')
    add(place, "java", "exit 0")
    done = spy(place, "--build-only")
    assert done.returncode == 0, done.stderr
    compiled = (place / ".venv" / "lcmtypes.jar").read_text()
    for source in (ROOT / "lcmtypes").glob("*.lcm"):
        assert f"lcmtypes/{source.stem}.java" in compiled
    dark = spy(place)
    assert dark.returncode == 2
    assert "DISPLAY is not set" in dark.stderr
    shown = spy(place, "udpm://239.255.76.67:7001?ttl=0", DISPLAY=":9")
    assert shown.returncode == 0, shown.stderr
    calls = (place / "calls").read_text().splitlines()
    assert [call.split()[0] for call in calls] == ["javac", "jar", "java"], "compiled once"
    assert str(place / ".venv" / "lcmtypes.jar") in calls[-1]
    assert "lcm.spy.Spy" in calls[-1]
    assert "--lcm-url=udpm://239.255.76.67:7001?ttl=0" in calls[-1]
    assert (Path(lcm.LCM_BIN_DIR) / "lcm-spy").exists()
