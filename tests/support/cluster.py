"""A cluster of dask.distributed on this machine."""

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

LIMIT_S = 60.0
HOST = ("--host", "127.0.0.1")


@contextlib.contextmanager
def cluster(folder: Path, workers: int):
    """Give the process of a scheduler and its address; what it says goes to files in a folder."""
    dask = [sys.executable, "-m", "dask"]
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "studies")]
    of_tests = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    said, log_file = folder / "scheduler.json", folder / "dask.log"
    command = [*dask, "scheduler", *HOST, "--no-dashboard", "--port", "0"]
    with contextlib.ExitStack() as stack, log_file.open("w") as log:

        def start(*words: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(words, stdout=log, stderr=log, env=of_tests)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        scheduler = start(*command, "--scheduler-file", str(said))
        end_s = time.monotonic() + LIMIT_S
        # The file is made first and filled then.
        while not (said.exists() and said.read_text().rstrip().endswith("}")):
            assert time.monotonic() < end_s, log_file.read_text()
            os.sched_yield()
        address = json.loads(said.read_text())["address"]
        worker = [*dask, "worker", address, *HOST, "--no-dashboard", "--nthreads", "1"]
        for _ in range(workers):
            start(*worker, "--no-nanny", "--local-directory", str(folder))
        yield scheduler, address
