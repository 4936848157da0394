"""The command line begins without what only some commands need."""

import subprocess
import sys

from klab import environment

HEAVY = {
    "numpy",
    "scipy",
    "casadi",
    "matplotlib",
    "lcm",
    "asyncio",
    "starlette",
    "importlib_metadata",
}
LATER = {"koopman_lab.data.decode", "offboard.desk.results", "offboard.controller.node"}
CODE = "import sys, offboard.cli.main; print('\\n'.join(sys.modules))"


def test_no_command_waits_for_what_another_one_needs():
    done = subprocess.run(
        [sys.executable, "-P" if sys.version_info >= (3, 11) else "-s", "-c", CODE],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert not (HEAVY | LATER) & set(done.stdout.split())
