"""A virtual environment with the base installation only, as on a robot's board."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMIT_S = 150.0

KLAB_THAT_TELLS = """
import atexit, json, sys, sysconfig
from pathlib import Path
file, *sys.argv[1:] = sys.argv[1:]

def tell():
    packages = Path(sysconfig.get_path("purelib"))
    found = set()
    for name, module in list(sys.modules.items()):
        place = getattr(module, "__file__", None)
        if place and packages in Path(place).parents:
            found.add(name.partition(".")[0])
    Path(file).write_text(json.dumps(sorted(found)))

atexit.register(tell)
from offboard.cli.main import main
main()
"""
"""`klab`, which writes at its end which top-level packages from outside it has imported."""

EACH_IN_TURN = """
import contextlib, io, json, sys
from offboard.cli.main import main

for line in sys.stdin:
    sys.argv = ["klab", *json.loads(line)]
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    print(json.dumps([code, out.getvalue(), err.getvalue()]))
"""
"""Many commands in one process: to start one for each takes longer than what is asked of it."""


class BaseInstallation:
    """The checkout built as for a release, and its wheel installed without extras.

    Parameters
    ----------
    where
        Takes the environment, and beside it what was built.

    Attributes
    ----------
    source_distribution, wheel
        What was built, the wheel from the source distribution.
    """

    def __init__(self, where: Path) -> None:
        built = where.with_name("dist")
        self._run(sys.executable, "-m", "build", "--outdir", built, ROOT)
        (self.source_distribution,) = built.glob("*.tar.gz")
        (self.wheel,) = built.glob("*.whl")
        self._run(sys.executable, "-m", "venv", where)
        self._programs = where / "bin"
        self._run(self.python, "-m", "pip", "install", "--quiet", self.wheel)

    @property
    def python(self) -> str:
        return str(self._programs / "python")

    def packages(self) -> dict[str, str]:
        """Return the versions of the distributions by their names."""
        listed = self._run(self.python, "-m", "pip", "list", "--format", "json")
        rows = json.loads(listed)
        return {row["name"].lower().replace("_", "-"): row["version"] for row in rows}

    def printed_by(self, code: str) -> str:
        """Run Python code, and return what it prints."""
        return self._run(self.python, "-c", code)

    def klab(self, *arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        return subprocess.run(
            [str(self._programs / "klab"), *map(str, arguments)],
            cwd=cwd,
            capture_output=True,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )

    def start(self, *arguments: str | Path, cwd: Path, imports: Path) -> subprocess.Popen[bytes]:
        """Start a command that writes at its end what it has imported."""
        # Of this name, because others look by the name whether a process is one of ours.
        program = imports.with_suffix("") / "klab"
        program.parent.mkdir()
        program.write_text(KLAB_THAT_TELLS)
        return subprocess.Popen([self.python, program, imports, *arguments], cwd=cwd)

    def each(self, lines: list[list[str]], cwd: Path) -> list[tuple[int, str, str]]:
        """Run commands one after another; return code, output and messages of each."""
        done = subprocess.run(
            [self.python, "-c", EACH_IN_TURN],
            input="".join(json.dumps(line) + "\n" for line in lines),
            cwd=cwd,
            capture_output=True,
            text=True,
            check=True,
            timeout=LIMIT_S,
        )
        return [tuple(json.loads(line)) for line in done.stdout.splitlines()]

    @staticmethod
    def _run(*words: str | Path) -> str:
        # Where this package lies must not be found by what is to find its own.
        clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run(words, env=clean, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
        return done.stdout
