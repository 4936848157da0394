"""With `--whole`, as CI calls it, a run fails where a folder of tests was left out."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[1] / "support"
SKIPPED = "import pytest\n\n@pytest.mark.skip\ndef test_one():\n    pass\n"
RUNS = "def test_one():\n    pass\n"
CASES = {
    "all folders": (RUNS, (), 0),
    "not one of them": (RUNS, ("--ignore=tests/second",), 1),
    "only files of one": (RUNS, ("tests/first/test_it.py",), 1),
    "all tests of one skipped": (SKIPPED, (), 1),
    "told apart by name": (RUNS, ("-k", "first"), 1),
}


@pytest.mark.parametrize("case", CASES)
def test_a_folder_of_which_no_test_ran_fails_the_run(tmp_path, case):
    second, arguments, code = CASES[case]
    for folder, text in (("first", RUNS), ("second", second)):
        (tmp_path / "tests" / folder).mkdir(parents=True)
        (tmp_path / "tests" / folder / "test_it.py").write_text(text)
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\n")
    options = ("-p", "whole_suite", "--whole", "--numprocesses", "1")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(SUPPORT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout
    named = f"LEFT OUT: no test of {tmp_path / 'tests' / 'second'} ran"
    assert (named in done.stdout) == (code != 0)
