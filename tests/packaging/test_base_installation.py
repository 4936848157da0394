"""The base installation, as on a robot's board: what it brings, what works in it, what refuses.

Every command of `klab` either does its job here without the desk's packages, or refuses in one line
before anything starts.
"""

import json
import signal
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import metadata
from pathlib import Path

import pytest
import typer
from base_installation import BaseInstallation
from klab import SHORT_RUNS
from real_bus import Ear, other

from koopman_lab.bus.channels import HEARTBEATS, ONBOARD_STATUS
from koopman_lab.files import CACHE_VARIABLE
from koopman_lab.installation import install_command, packages
from offboard.cli.main import app
from offboard.commands.guide import GUIDES
from offboard.terminal.needs import commands, needs_of

COMMANDS = dict(commands(typer.main.get_command(app)))
DIRECT = {"lcm", "numpy", "pydantic", "rich", "typer", "yaml"}
"""The top-level packages that the base is made of; a node imports all, NumPy where it counts."""
BROUGHT = {
    "packaging",  # of the base, too: where plug-ins or extras are looked at
    *("_distutils_hack", "setuptools"),  # Python's own, where it brings them
    *("annotated_types", "pydantic_core", "typing_extensions", "typing_inspection"),  # pydantic
    *("annotated_doc", "click", "shellingham"),  # typer
    *("markdown_it", "mdurl", "pygments"),  # rich
}
"""What these bring along; which of them are imported is a matter of their versions."""
OURS = {"koopman_lab", "lcmtypes", "offboard", "onboard"}
ROOT = Path(__file__).parents[2]

AT_REST, SHORT = ("0", "0", "0"), ("--segments", "1", *SHORT_RUNS)
ALONE = (
    ("calibrate", ("--lockstep", *SHORT, "--out", "session")),
    ("reference", ("--lockstep", "--shape", "square", "--runs", "1", "--out", "runs")),
    ("log info", ("session",)),
    ("log export", ("session",)),
    ("rerun", ("session", "--node", "sampler")),
    ("rerun", ("runs", "--node", "reference")),
    ("rerun", ("session", "--node", "onboard")),
    ("dataset make", ("session", "--out", "pairs.npz")),
    ("dataset info", ("pairs.npz",)),
    ("dataset export", ("pairs.npz", "--out", "published")),
    ("dataset import", ("published", "--out", "again.npz")),
    ("bench lockstep", ("--seconds", "2")),
    ("bench motor", ()),
    ("bench authentication", ("--messages", "100")),
    ("key new", ("lab.key",)),
    ("config check", ()),
    ("config show", ()),
    ("config keys", ("--only", "horizon")),
    ("runs", (".",)),
    ("bench start", ("--rounds", "1")),
    ("log verify", ("session",)),
    ("bench estop", ("--tries", "1", "--load", "0")),
    ("bench dataset", ("session", "--repetitions", "1")),
    ("doctor", ()),
    *(("guide", (topic,)) for topic in GUIDES),
)
"""Jobs that need no other process, each on what those before it left."""
BESIDE = (
    ("topics", ("--once",)),
    ("status", ()),
    ("estop", ()),
    ("estop", ("--release",)),
    ("fault", ("occlusion", "--duration-s", "0.1")),
    ("calibrate", (*SHORT, "--out", "real")),
)
"""Jobs beside plant and onboard loop."""
NODES = {
    "logger": ("--out", "by-hand"),
    "sampler": (),
    "reference": ("--shape", "square"),
    "slalom": (),
}
"""What else runs beside them, until Ctrl-C."""
HARDWARE = {"driver": "plant", "mocap": "mocap"}
"""What runs in place of the plant, each by itself, and whose heartbeat it has."""
BENCHES = ("realtime", "logger")
"""These start a lab of their own, one of them with the pacer."""
DRIVING = ONBOARD_STATUS.type.DRIVING


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    return BaseInstallation(tmp_path_factory.mktemp("base") / "venv")


@pytest.fixture
def ear(bus_url):
    return Ear(bus_url)


def test_what_is_built_passes_the_checks_of_a_package_index(base):
    command = (sys.executable, "-m", "twine", "check", "--strict")
    done = subprocess.run(
        [*command, base.source_distribution, base.wheel],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("PASSED") == 2


def test_wheel_and_source_distribution_are_of_one_version_and_the_wheel_is_whole(base):
    version = base.packages()["koopman-lab"]
    assert base.source_distribution.name == f"koopman_lab-{version}.tar.gz"
    assert base.wheel.name == f"koopman_lab-{version}-py3-none-any.whl"
    with zipfile.ZipFile(base.wheel) as wheel:
        names = set(wheel.namelist())
    information = f"koopman_lab-{version}.dist-info"
    assert {name.partition("/")[0] for name in names} == OURS | {information}
    assert f"{information}/licenses/LICENSE" in names
    tracked = subprocess.run(
        ["git", "ls-files", *(OURS - {"lcmtypes"})],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    assert set(tracked) <= names
    types = {file.stem for file in (ROOT / "lcmtypes").glob("*.lcm")}
    generated = {f"lcmtypes/{name}{suffix}" for name in types for suffix in (".py", ".pyi")}
    rest = {"lcmtypes/__init__.py", "lcmtypes/__init__.pyi", "lcmtypes/py.typed"}
    assert generated | rest <= names


def test_the_source_distribution_holds_what_was_built_from_and_the_tests(base):
    with tarfile.open(base.source_distribution) as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    listing = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    ours = {name for name in listing.stdout.splitlines() if not name.startswith(".")}
    assert ours <= names


def test_it_brings_what_a_board_needs_and_nothing_of_the_desk(base):
    installed = base.packages()
    assert {"lcm", "numpy", "packaging", "pydantic", "pyyaml", "rich", "typer"} <= installed.keys()
    for extra in metadata("koopman-lab").get_all("Provides-Extra"):
        assert not installed.keys() & set(packages(extra))


def test_motor_loop_and_plant_speak_and_import_nothing_of_the_desk(base, ear, tmp_path):
    """And a robot is driven by them: other processes calibrate it over UDP."""
    nodes = {}
    try:
        for name in ("plant", "onboard"):
            nodes[name] = base.start("run", name, cwd=tmp_path, imports=tmp_path / f"{name}.json")
        assert ear.wait_for(*nodes) == {name: node.pid for name, node in nodes.items()}
        ear.wait(lambda: ear.status is not None)
        for words, arguments in BESIDE:
            done = base.klab(*words.split(), *arguments, cwd=tmp_path)
            assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
        assert (tmp_path / "real" / "summary.json").exists()
        assert not (tmp_path / "real" / "processes" / "plant.log").exists()
        for name, arguments in NODES.items():
            imports = tmp_path / f"{name}.json"
            node = base.start("run", name, *arguments, cwd=tmp_path, imports=imports)
            nodes[name] = node
            if name in HEARTBEATS:
                ear.wait(lambda name=name, node=node: ear.pids.get(name) == node.pid)
            else:
                ear.wait(lambda: ear.status.state == DRIVING)
            end(node)
    finally:
        for node in nodes.values():
            end(node)
    for name in nodes:
        imported = set(json.loads((tmp_path / f"{name}.json").read_text())) - OURS
        assert DIRECT - {"numpy"} <= imported - BROUGHT <= DIRECT, name


def test_motors_and_cameras_run_apart_and_import_nothing_of_the_desk(base, ear, tmp_path):
    nodes = {}
    try:
        for name in HARDWARE:
            arguments = ("run", name, "--driver", "plant")
            nodes[name] = base.start(*arguments, cwd=tmp_path, imports=tmp_path / f"{name}.json")
        pids = {HARDWARE[name]: node.pid for name, node in nodes.items()}
        assert ear.wait_for(*pids) == pids
    finally:
        for node in nodes.values():
            end(node)
    for name in nodes:
        imported = set(json.loads((tmp_path / f"{name}.json").read_text())) - OURS
        assert DIRECT - {"numpy"} <= imported - BROUGHT <= DIRECT, name


def end(node):
    """Interrupt a node and expect that it ends in order."""
    if node.poll() is None:
        node.send_signal(signal.SIGINT)
    assert node.wait(timeout=30) == 0


def test_a_lab_is_started_and_ended(base, ear, tmp_path):
    lab = base.start("up", "--out", "up", cwd=tmp_path, imports=tmp_path / "up.json")
    try:
        ear.wait_for("plant", "onboard", "logger")
        assert base.klab("down", cwd=tmp_path).returncode == 0
        assert lab.wait(timeout=30) == 130
    finally:
        lab.kill()
        lab.wait()
    for name in BENCHES:
        done = base.klab("bench", name, "--minutes", "0.05", "--out", name, cwd=tmp_path)
        assert done.returncode == 0, done.stderr


def test_jobs_without_other_processes_are_done(base, tmp_path):
    lines = [[*words.split(), *arguments] for words, arguments in ALONE]
    for line, (code, out, err) in zip(lines, base.each(lines, cwd=tmp_path), strict=True):
        assert code == 0, f"{line}\n{out}{err}"


def test_the_library_gives_out_what_works_here_and_says_what_installs_the_rest(base):
    asks = """
import koopman_lab as kl
for name in kl.__all__:
    try:
        getattr(kl, name)
    except kl.LabError as error:
        print(name, str(error).splitlines()[-1], sep=": ")
"""
    refused = dict(line.split(": ", 1) for line in base.printed_by(asks).splitlines())
    assert {"Controller", "plot_paths"} <= refused.keys()
    assert not {"DataSet", "LabConfig", "load_config", "read_data"} & refused.keys()
    for name, said in refused.items():
        assert said.startswith(f"koopman_lab.{name} needs packages that are not installed"), said
        assert said.endswith(install_command("desk")), said


def test_a_log_is_replayed_and_a_goal_is_asked_for(base, bus_url, tmp_path):
    reference = Path(__file__).parents[1] / "data" / "reference" / "park.lcm"
    replay = ("replay", reference, "--speed", "20", "--url", other(bus_url))
    done = base.klab(*replay, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    done = base.klab("goal", *AT_REST, cwd=tmp_path)
    assert "R1_MPC_STATE is silent" in done.stderr


def test_every_other_command_is_tried_here():
    tried = {words for words, _ in (*ALONE, *BESIDE)} | {f"run {name}" for name in NODES}
    tried |= {f"bench {name}" for name in BENCHES} | {"run pacer", "run plant", "run onboard"}
    tried |= {f"run {name}" for name in HARDWARE}
    # What relays needs no more than who replays; tests/commands/test_relay.py runs it.
    tried |= {"up", "down", "replay", "goal", "relay"}
    # What it floods is what `bench realtime` starts; tests/bench runs it.
    tried |= {"bench flood"}
    always = {n for n, c in COMMANDS.items() if any(not x.option for x in needs_of(c.callback))}
    assert tried.isdisjoint(always)
    assert tried | always == COMMANDS.keys()


def typed(parameter) -> list[str]:
    """Return something for a parameter; nothing of what is required here is more than a word."""
    values = ["1"] * max(parameter.nargs, 1)
    return [parameter.opts[0], *values] if parameter.opts[0].startswith("-") else values


def refused() -> list[tuple[str, list[str]]]:
    """Return by extra each command line that needs it: what is required, and what makes it so."""
    lines = []
    for words, command in COMMANDS.items():
        required = [p for p in command.params if p.required]
        for extra, option in needs_of(command.callback):
            name, *value = option.split() or [""]
            given = [word for p in required if name not in p.opts for word in typed(p)]
            for parameter in command.params:
                if option and name in parameter.opts:
                    flag = getattr(parameter, "is_flag", False)
                    given += [name, *value] if value or flag else typed(parameter)
            lines.append((extra, [*words.split(), *given]))
    return lines


def test_what_needs_more_refuses_in_one_line_before_anything_starts(base, tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    folder = tmp_path / "here"
    folder.mkdir()
    lines = refused()
    assert len(lines) > 30
    answers = base.each([line for _, line in lines], cwd=folder)
    for (extra, line), (code, out, err) in zip(lines, answers, strict=True):
        # Who lacks the cluster lacks the desk, which is asked for first.
        commands_that_help = {install_command(extra), install_command("desk")}
        assert (code, out) == (2, ""), (line, out, err)
        (said,) = err.splitlines()
        assert any(said.endswith(command) for command in commands_that_help), (line, said)
    assert not list(folder.iterdir())
    assert not (tmp_path / "cache").exists()


def test_help_is_always_given(base, tmp_path):
    lines = [[*words.split(), "--help"] for words in COMMANDS]
    for line, (code, out, err) in zip(lines, base.each(lines, cwd=tmp_path), strict=True):
        assert (code, err) == (0, ""), line
        command = COMMANDS[" ".join(line[:-1])]
        for extra, _ in needs_of(command.callback):
            assert install_command(extra) in " ".join(out.split()), line


def test_doctor_says_what_is_missing_for_what(base, tmp_path):
    done = base.klab("doctor", cwd=tmp_path)
    assert "installation: ok (base, enough for a robot's board)" in done.stdout
    assert "matplotlib" in done.stdout
    assert "park" in done.stdout
    assert install_command("desk") in done.stdout
