"""Change the code of rooms, one thing at a time, and print the changes that no test notices.

`./scripts/mutate` calls this where mutmut is installed. mutmut makes the changes (an operator, a
number, an argument ...) and runs those tests of the room that come by the changed function; code
outside of functions, and properties, it leaves alone. All of it happens in a copy of the tree.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import NamedTuple

ROOMS = {
    "onboard/motor_loop": ("tests/onboard", "tests/bus/test_commanders.py"),
    "offboard/desk": (
        *("tests/desk", "tests/controller", "tests/sampler", "tests/reference"),
        "tests/bus/test_commanders.py",
    ),
    "koopman_lab/eventlog": ("tests/eventlog",),
}
"""The rooms that are mutated unless others are named, and the tests of each."""
REPORT_S = 60.0
KILLED, SURVIVED, UNREACHED, UNTRIED = "killed", "survived", "no test", "not tried"
OUTCOMES = {0: SURVIVED, 5: UNREACHED, 33: UNREACHED, None: UNTRIED, 2: UNTRIED}
"""By mutmut's exit code of a mutant's tests; what is not here failed, crashed, or never ended."""


class Mutant(NamedTuple):
    """One change.

    Attributes
    ----------
    name
        As mutmut has it.
    file, line
        Where it is, in the tree; lines count from 1.
    before, after
        The code there, of one line mostly.
    """

    name: str
    file: Path
    line: int
    before: str
    after: str


def main() -> None:
    """Mutate what the command line asks for."""
    rooms = ", ".join(ROOMS)
    parser = argparse.ArgumentParser("./scripts/mutate", description=__doc__.split("\n\n")[0])
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=f"folders or files ({rooms})")
    parser.add_argument("--tests", nargs="+", help="what must notice; default: the rooms' tests")
    parser.add_argument("--share", type=share, default=1.0, help="of the mutants, at random (1)")
    parser.add_argument("--seed", type=int, default=0, help="of that choice, and of hypothesis (0)")
    parser.add_argument("--minutes", type=float, default=30.0, help="for each room at most (30)")
    parser.add_argument("--processes", type=int, default=1, help="at the same time (1)")
    asked = parser.parse_args()
    for room in asked.rooms or ROOMS:
        tests = asked.tests or tests_of(room)
        if not Path(room).exists() or not all(Path(test).exists() for test in tests):
            parser.error(
                f"{room}, or one of its tests ({', '.join(tests)}), is not here; see --tests"
            )
        with tempfile.TemporaryDirectory(prefix="mutate-") as folder:
            mutate(room, tests, asked, Path(folder))


def share(text: str) -> float:
    """Return the share that a person has typed."""
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and at most 1")
    return value


def tests_of(room: str) -> Sequence[str]:
    """Return the tests of a room: those of the table, or the folder of the same name."""
    for name, tests in ROOMS.items():
        if Path(room) == Path(name) or Path(name) in Path(room).parents:
            return tests
    return (f"tests/{(Path(room) if Path(room).is_dir() else Path(room).parent).name}",)


def mutate(room: str, tests: Sequence[str], asked: argparse.Namespace, folder: Path) -> None:
    """Mutate a room in a folder of its own, and print what survives."""
    tree, temporary = folder / "tree", folder / "tmp"
    temporary.mkdir()
    copy_tree(tree)
    files = sorted(Path(room).rglob("*.py")) if Path(room).is_dir() else [Path(room)]
    write_settings(tree, files, tests, asked.seed)
    home = Path.cwd()
    os.chdir(tree)  # where mutmut looks for its settings, also as it is imported
    mutants = [mutant for file in files for mutant in mutants_of(file)]
    chosen = random.Random(asked.seed).sample(mutants, round(asked.share * len(mutants)))
    print(f"{room}: {len(chosen)} of {len(mutants)} mutants, against {' '.join(tests)}", flush=True)
    if chosen:
        run(chosen, asked, temporary)
    os.chdir(home)
    print_result(room, chosen, outcomes(tree, files))


def copy_tree(target: Path) -> None:
    """Copy what belongs to the repository, as it is now."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    for name in filter(None, listed.split("\0")):
        if Path(name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(name, target / name)


def write_settings(tree: Path, files: Iterable[Path], tests: Sequence[str], seed: int) -> None:
    """Write mutmut's settings into a copy of the tree."""
    packages = {file.relative_to(tree).parts[0] for file in tree.rglob("*.py")}
    sources = sorted(name for name in packages if name not in ("tests", "scripts"))
    settings = {
        "source_paths": sources,
        "only_mutate": [str(file) for file in files],
        "also_copy": sorted(p.name for p in tree.iterdir() if p.name not in sources),
        "pytest_add_cli_args_test_selection": list(tests),
        "pytest_add_cli_args": [f"--hypothesis-seed={seed}", "-p", "no:cacheprovider"],
        "timeout_multiplier": 5.0,
        "use_git_change_detection": False,
    }
    with (tree / "pyproject.toml").open("a") as project:
        project.write("\n[tool.mutmut]\n")
        # Lists of plain strings and numbers are the same in JSON and TOML.
        project.writelines(f"{key} = {json.dumps(value)}\n" for key, value in settings.items())


def mutants_of(file: Path) -> list[Mutant]:
    """Return all mutants of a file of the present folder."""
    from mutmut.mutation.file_mutation import mutate_file_contents
    from mutmut.utils.format_utils import (
        get_mutant_name,
        mangled_name_from_mutant_name,
        orig_function_and_class_names_from_key,
    )

    source = file.read_text()
    mutated, defined = mutate_file_contents(str(file), source), definitions(source)
    lines = mutated.code.splitlines()

    def function(name: str, shown: str) -> list[str]:
        span = mutated.line_span_by_function_name[name]
        return [line.replace(name, shown) for line in lines[span.start - 1 : span.end]]

    mutants = []
    for mutant in mutated.mutant_names:
        name = get_mutant_name(file, mutant)
        shown, owner = orig_function_and_class_names_from_key(name)
        before = function(f"{mangled_name_from_mutant_name(mutant)}__mutmut_orig", shown)
        after = function(mutant, shown)
        first = next(k for k, line in enumerate(before) if line.lstrip().startswith(DEFINES))
        begin = defined[owner, shown] - first
        mutants.append(Mutant(name, file, *difference(before, after, begin)))
    return mutants


DEFINES = ("def ", "async def ")


def definitions(source: str) -> dict[tuple[str | None, str], int]:
    """Return the lines of all functions of a module and of its classes, by their owner and name."""
    begins: dict[tuple[str | None, str], int] = {}
    for node in ast.parse(source).body:
        of_class = isinstance(node, ast.ClassDef)
        for part in node.body if of_class else [node]:
            if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                begins[node.name if of_class else None, part.name] = part.lineno
    return begins


def difference(before: Sequence[str], after: Sequence[str], begin: int) -> tuple[int, str, str]:
    """Return the first line in which two texts differ, and what stands there in each."""
    for tag, i1, i2, j1, j2 in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if tag != "equal":
            return (
                begin + i1,
                *(" ".join(map(str.strip, t)) for t in (before[i1:i2], after[j1:j2])),
            )
    return begin, "", ""


def run(chosen: Sequence[Mutant], asked: argparse.Namespace, temporary: Path) -> None:
    """Let mutmut try mutants until it is done or the time is up.

    Raises
    ------
    SystemExit
        If the tests fail without any mutant; what mutmut said is printed.
    """
    names = sorted(mutant.name for mutant in chosen)
    tool = Path(sys.executable).with_name("mutmut")
    log = temporary / "log"
    with log.open("w") as said:
        process = subprocess.Popen(
            [tool, "run", "--max-children", str(asked.processes), *names],
            env=os.environ | {"TMPDIR": str(temporary)},
            stdout=said,
            stderr=subprocess.STDOUT,
        )
        wait(process, 60.0 * asked.minutes, log)
    if process.returncode:
        print(log.read_text()[-10_000:], file=sys.stderr)
        sys.exit(f"./scripts/mutate: mutmut ended with {process.returncode}; what it said is above")


def wait(process: subprocess.Popen[bytes], seconds: float, log: Path) -> None:
    """Wait until mutmut is done, and stop it when the time is up or a person stops this."""
    end_s = time.monotonic() + seconds
    try:
        while process.poll() is None and time.monotonic() < end_s:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=max(0.0, min(REPORT_S, end_s - time.monotonic())))
                break
            print(f"  {last_line(log)}", file=sys.stderr)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass  # the terminal has told mutmut as well
    process.wait()


def last_line(log: Path) -> str:
    """Return what mutmut has said last; it writes over its lines."""
    return "".join(log.read_text().replace("\r", "\n").split("\n")[-1:]).strip()


def outcomes(tree: Path, files: Iterable[Path]) -> dict[str, str]:
    """Return what became of the mutants that mutmut has made, by their names."""
    notes = [tree / "mutants" / f"{file}.meta" for file in files]
    return {
        name: OUTCOMES.get(code, KILLED)
        for note in notes
        if note.exists()
        for name, code in json.loads(note.read_text())["exit_code_by_key"].items()
    }


def print_result(room: str, chosen: Iterable[Mutant], by_name: dict[str, str]) -> None:
    """Print what no test has noticed, and how many there are of what."""
    counts: Counter[str] = Counter()
    for mutant in sorted(chosen, key=lambda mutant: (mutant.file, mutant.line)):
        outcome = by_name.get(mutant.name, UNTRIED)
        counts[outcome] += 1
        if outcome in (SURVIVED, UNREACHED):
            print(f"{mutant.file}:{mutant.line}: {outcome}: {mutant.after or '(removed)'}")
            print(f"    instead of: {mutant.before}")
    said = ", ".join(f"{counts[kind]} {kind}" for kind in (KILLED, SURVIVED, UNREACHED, UNTRIED))
    print(f"{room}: {said}", flush=True)


if __name__ == "__main__":
    main()
