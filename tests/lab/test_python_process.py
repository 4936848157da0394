"""Processes of our own, started from a person's folder."""

import subprocess
import sys

import pytest

from offboard.lab.python_process import module_command


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 has no -P")
@pytest.mark.parametrize("module", ["random", "lcm", "offboard"])
def test_a_file_of_a_persons_folder_is_not_taken_for_a_module(module, tmp_path):
    (tmp_path / f"{module}.py").write_text("raise SystemExit('imported from the folder')\n")
    told = subprocess.run(
        module_command("offboard.cli.main", "run", "plant", "--help"),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    assert "Stand in for hardware" in told.stdout
