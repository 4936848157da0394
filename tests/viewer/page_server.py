"""The page's server in a process of its own, and what strangers send to it."""

import os
import re
import signal
import subprocess
from contextlib import contextmanager

from klab import KLAB

LIMIT_S = 20.0
URL = f"bus.url={os.environ['LCM_DEFAULT_URL']}"


@contextmanager
def serving(*arguments, cwd=None):
    """Run the server; give its process and the address that it prints."""
    process = subprocess.Popen(
        [*KLAB, "view", "--set", URL, "--port", "0", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
    )
    try:
        yield process, re.search(r"http://\S+", process.stderr.readline()).group()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130
