"""Which process numbers `klab down` may act on: the machine itself says who they are."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from offboard.lab.own_processes import is_klab, is_started_by, klab_arguments

LIMIT_S = 60.0
WAITS = "import sys; print('here', flush=True); sys.stdin.read()"


def running(tmp_path, *words, executable=sys.executable):
    """Start a program with these arguments that speaks, and waits for its end of input."""
    process = subprocess.Popen(
        [executable, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=tmp_path
    )
    process.stdin.write(b"speak\n")
    process.stdin.flush()
    assert process.stdout.readline()
    return process


@pytest.fixture
def started():
    processes = []
    yield processes.append
    for process in processes:
        process.stdin.close()
        process.stdout.close()
        try:
            process.wait(LIMIT_S)
        finally:
            process.kill()


def script(tmp_path: Path, name: str) -> Path:
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(WAITS)
    return path


def module_path(tmp_path):
    """Make a module of the name of ours, found before it, that waits."""
    script(tmp_path, "offboard/cli/main.py")
    script(tmp_path, "offboard/cli/end_with_parent.py")
    for folder in ("offboard", "offboard/cli"):
        (tmp_path / folder / "__init__.py").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        (["bin/klab", "up", "--robot-name", "R2"], ["up", "--robot-name", "R2"]),
        (["-P", "-W", "error", "bin/klab", "park"], ["park"]),
        (["-m", "offboard.cli.main", "run", "onboard"], ["run", "onboard"]),
        (["-X", "utf8", "-m", "offboard.cli.main"], []),
        (["offboard/cli/main.py", "down"], ["down"]),
        (
            ["-m", "offboard.cli.end_with_parent", "7", "park", "--seed", "1"],
            ["park", "--seed", "1"],
        ),
    ],
)
def test_python_that_runs_klab_is_klab(tmp_path, started, words, arguments):
    script(module_path(tmp_path), "bin/klab")
    process = running(tmp_path, *words)
    started(process)
    assert klab_arguments(process.pid) == arguments


@pytest.mark.parametrize(
    "words",
    [
        ["-c", WAITS, "klab"],
        ["-c", WAITS, "-m", "offboard.cli.main", "run", "onboard"],
        ["other.py", "bin/klab", "run", "onboard"],
        ["-W", "bin/klab", "other.py", "offboard.cli.main"],
        ["-m", "other", "offboard.cli.main"],
        ["notklab", "up"],
    ],
)
def test_a_program_that_only_names_klab_is_none(tmp_path, started, words):
    for name in ("bin/klab", "other.py", "notklab"):
        script(tmp_path, name)
    process = running(tmp_path, *words)
    started(process)
    assert klab_arguments(process.pid) is None


def test_an_editor_of_a_file_named_klab_is_none(tmp_path, started):
    process = running(tmp_path, "-", "klab", executable="/bin/cat")
    started(process)
    assert not is_klab(process.pid)


@pytest.mark.parametrize("pid", [0, -1, 1, 2**22 + 1])
def test_what_is_no_process_of_this_user_is_none(pid, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    assert not is_klab(pid)
    assert not is_klab(os.getpid())


def test_a_child_of_klab_is_known_by_its_node_and_its_parent(tmp_path, started):
    main = module_path(tmp_path) / "offboard" / "cli" / "main.py"
    main.write_text(
        "import os, subprocess, sys\n"
        "if sys.argv[1] == 'up':\n"
        "    words = [sys.executable, '-m', 'offboard.cli.main', 'run', 'plant']\n"
        "    subprocess.run(words)\n"
        "else:\n"
        "    print(os.getpid(), flush=True)\n"
        "    sys.stdin.read()\n"
    )
    command = [sys.executable, "-m", "offboard.cli.main", "up"]
    supervisor = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=tmp_path, text=True
    )
    started(supervisor)
    child = int(supervisor.stdout.readline())
    assert is_started_by(child, "plant", supervisor.pid)
    assert not is_started_by(child, "onboard", supervisor.pid)
    assert not is_started_by(child, "plant", os.getpid())
    assert not is_started_by(supervisor.pid, "plant", supervisor.pid)
