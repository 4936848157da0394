"""Each test process gets an LCM bus of its own, set before anything opens one."""

import contextlib
import json
import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# One thread for linear algebra: the tests run side by side on few cores.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

# They start hundreds of processes, each of which would otherwise compile all modules anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

_RUN = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
_WORKER = os.environ.get("PYTEST_XDIST_WORKER", "main")
_PORT = 20_000 + zlib.crc32(f"{_RUN} {_WORKER}".encode()) % 10_000
os.environ["LCM_DEFAULT_URL"] = f"udpm://239.255.76.67:{_PORT}?ttl=0"

# What a run compiles is the run's. Workers inherit the folder; who made it removes it.
_CACHE = None
if "KOOPMAN_LAB_CACHE" not in os.environ:
    _CACHE = os.environ["KOOPMAN_LAB_CACHE"] = tempfile.mkdtemp(prefix="koopman-lab-")

# Stopped robots of tests are none of this user's, and each process has its own.
_STATE = Path(os.environ["KOOPMAN_LAB_CACHE"]) / f"state-{_PORT}"
os.environ["KOOPMAN_LAB_STATE"] = str(_STATE)

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

pytest_plugins = ("whole_suite",)

# How long an example takes says how busy the machine is, not whether the code is right.
settings.register_profile("lab", deadline=None)
settings.load_profile("lab")


SPREAD = (
    *("test_first_hour.py", "test_real_time.py", "test_bench.py", "test_worked_examples.py"),
    *("test_lines_live.py", "test_lines.py", "test_faults_real_time.py"),
)
"""Files of long tests, each of which may run in another process than the others of its file.

They share nothing, or share it among processes.
"""
LONGEST_FIRST = (
    *("test_base_installation.py", "test_mutate.py", "test_newcomer.py", "test_site.py"),
    *SPREAD,
)
"""Files to begin with, so that the others run beside them and not behind them."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files."""
    places = {name: place for place, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep a file in one process, so that what it records once is recorded once."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return nodeid if file.endswith(SPREAD) else file

    return Scheduling(config, log) if config.getvalue("dist") == "loadfile" else None


def pytest_unconfigure() -> None:
    """Remove what the run compiled."""
    if _CACHE is not None:
        shutil.rmtree(_CACHE, ignore_errors=True)


@pytest.fixture(autouse=True)
def _ordinary_priority() -> Iterator[None]:
    """Give up the priority that a node had which ran in this process: children would inherit it."""
    yield
    with contextlib.suppress(OSError, AttributeError):
        if os.sched_getscheduler(0) != os.SCHED_OTHER:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@pytest.fixture(autouse=True, scope="module")
def _labs_forgotten() -> Iterator[None]:
    """Forget the labs that a file's tests broke: they are no news to those of the next."""
    yield
    port = f":{_PORT}?"
    for note in (Path(os.environ["KOOPMAN_LAB_CACHE"]) / "labs").glob("*.json"):
        with contextlib.suppress(FileNotFoundError):  # other processes' labs come and go
            if port in json.loads(note.read_text())["bus"]:
                note.unlink()


@pytest.fixture(autouse=True)
def _stops_forgotten() -> Iterator[None]:
    """Let no test's robot be stopped because a test before stopped one of its name."""
    yield
    for record in _STATE.glob("stops/*.json"):
        record.unlink()


@pytest.fixture
def bus_url() -> str:
    """Return the LCM URL of this test process."""
    return os.environ["LCM_DEFAULT_URL"]
