"""The workflows: valid, each action pinned, each command a script of ours, on every Python."""

import copy
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from check_jsonschema import main as check_jsonschema
from click.testing import CliRunner, Result

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from dependencies import PYTHONS  # noqa: E402

GITHUB = ROOT / ".github"
WORKFLOWS = {file.name: file.read_text() for file in sorted((GITHUB / "workflows").glob("*.yml"))}
FORMS = [file for file in (GITHUB / "ISSUE_TEMPLATE").glob("*.yml") if file.stem != "config"]
PINNED = re.compile(r" +(?:- )?uses: [\w-]+/[\w.-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+")
SHELL = re.compile(r"[|&;<>`\\\n]|\$[({]")
"""What would make more of a line than one command and its arguments."""


def scripts() -> set[str]:
    """Return the scripts that can be called."""
    listed = subprocess.run(
        ["git", "ls-files", "--stage", "scripts"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    rows = (line.split() for line in listed.splitlines())
    return {f"./{name}" for mode, _, _, name in rows if mode == "100755"}


SCRIPTS = scripts()


def findings(workflow: dict, text: str) -> list[str]:
    """Return what is wrong with a workflow."""
    lines = [line for line in text.splitlines() if "uses:" in line]
    wrong = [f"not pinned: {line.strip()}" for line in lines if not PINNED.fullmatch(line)]
    if workflow.get("permissions") != {"contents": "read"}:
        wrong.append("may do more than read")
    for name, job in workflow["jobs"].items():
        if "permissions" in job:
            wrong.append(f"{name}: has permissions of its own")
        if "timeout-minutes" not in job:
            wrong.append(f"{name}: may run for hours")
        for step in job["steps"]:
            wrong += [f"{name}: {words}" for words in findings_of_step(step)]
    return wrong


def findings_of_step(step: dict) -> list[str]:
    """Return what is wrong with a step."""
    if "run" in step:
        command = step["run"].strip()
        if SHELL.search(command):
            return [f"more than one command: {command}"]
        program = shlex.split(command)[0]
        return [] if program in SCRIPTS else [f"no script of ours: {program}"]
    wrong, options = [], step.get("with", {})
    if step["uses"].startswith("actions/checkout@"):
        if options.get("persist-credentials") is not False:
            wrong.append("keeps the token beside the code")
        if options.get("fetch-depth") != 0:
            wrong.append("has no tags, from which the version comes")
    return wrong


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_calls_scripts_of_ours_and_pinned_actions_only(name):
    assert findings(yaml.safe_load(WORKFLOWS[name]), WORKFLOWS[name]) == []


FAULTS = {
    "./scripts/test\n": ("./scripts/tests\n", "no script of ours: ./scripts/tests"),
    "- run: ./scripts/test\n": ("- run: pytest\n", "no script of ours: pytest"),
    "run: ./scripts/test": ("run: ./scripts/test || true", "more than one command"),
    "run: ./scripts": ("run: ./scripts/test $(cat x) #", "more than one command"),
    "run: ./scripts/": ("run: ./scripts/test ${{ github.head_ref }} #", "more than one command"),
    "@08c6903cd8c0fde910a37f88322edcfb5dd907a8": ("@v5", "not pinned: - uses: actions/checkout@v5"),
    " # v5.0.0": ("", "not pinned: - uses: actions/checkout@08c6903c"),
    "persist-credentials: false": ("clean: true", "keeps the token beside the code"),
    "fetch-depth: 0": ("fetch-depth: 1", "has no tags"),
    "contents: read": ("contents: write", "may do more than read"),
    "timeout-minutes: 60\n": ("permissions: write-all\n", "has permissions of its own"),
    "    timeout-minutes: 60\n": ("", "may run for hours"),
}


@pytest.mark.parametrize("part", FAULTS)
def test_each_fault_of_a_workflow_is_found(part):
    other, words = FAULTS[part]
    text = WORKFLOWS["tests.yml"].replace(part, other)
    assert text != WORKFLOWS["tests.yml"]
    assert any(words in finding for finding in findings(yaml.safe_load(text), text))


def test_an_action_has_one_version_in_all_workflows():
    pinned = set(re.findall(r"uses: (\S+)@(\S+ # \S+)", "".join(WORKFLOWS.values())))
    assert len(dict(pinned)) == len(pinned) > 2


def test_changes_and_nights_try_every_python_and_changes_both_processors():
    matrices = {
        (name, job): workflow["jobs"][job]["strategy"]["matrix"]
        for name, job in (("tests.yml", "suite"), ("nightly.yml", "whole-suite"))
        for workflow in [yaml.safe_load(WORKFLOWS[name])]
    }
    for matrix in matrices.values():
        assert tuple(matrix["python"]) == PYTHONS
    assert matrices["tests.yml", "suite"]["machine"] == ["ubuntu-24.04", "ubuntu-24.04-arm"]
    (command,) = re.findall(r"run: (\./scripts/test.*)", WORKFLOWS["nightly.yml"])
    assert command == "./scripts/test --whole"


def test_the_scripts_look_for_every_python_by_its_name():
    text = (ROOT / "scripts" / "installation.sh").read_text()
    assert set(re.findall(r"\bpython(3\.\d+)\b", text)) == set(PYTHONS)


def check(schema: str, *files: Path) -> Result:
    """Compare files with a schema that comes with the checker."""
    return CliRunner().invoke(
        check_jsonschema, ["--builtin-schema", f"vendor.{schema}", *map(str, files)]
    )


@pytest.mark.parametrize(
    ("schema", "files"),
    [
        ("github-workflows", [GITHUB / "workflows" / name for name in WORKFLOWS]),
        ("github-issue-forms", FORMS),
        ("dependabot", [GITHUB / "dependabot.yml"]),
    ],
)
def test_what_the_forge_reads_has_its_form(schema, files, tmp_path):
    done = check(schema, *files)
    assert files
    assert done.exit_code == 0, done.output
    other = copy.deepcopy(yaml.safe_load(files[0].read_text()))
    other["surprise"] = 1
    (tmp_path / "other.yml").write_text(yaml.safe_dump(other))
    assert check(schema, tmp_path / "other.yml").exit_code == 1


def test_hooks_before_a_commit_call_scripts_of_ours():
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    (repository,) = config["repos"]
    assert repository["repo"] == "local"
    hooks = {hook["id"]: hook for hook in repository["hooks"]}
    assert hooks["check"]["entry"] == "./scripts/check"
    assert {hook["entry"] for hook in hooks.values()} <= SCRIPTS
