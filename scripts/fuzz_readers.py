"""Give damaged files to the readers of files for some minutes each; keep what they stumble over.

Files are drawn by hypothesis from the corpus of each target, tests/fuzz_corpus; the targets stand
in tests/support/fuzz_targets.py. A find is made as small as it gets and written into the corpus.
"""

from __future__ import annotations

import argparse
import hashlib
import logging
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from tests.support.fuzz_targets import CORPUS, TARGETS, Target, survive

MINUTES = 30.0
ROUND = 200
"""Files between two looks at the clock."""
SLOW_S = 2.0
"""A file that takes longer is a find, too."""
MOST_MEMORY_BYTES = 4 << 30


class TookTooLongError(Exception):
    """A reader took longer over a small file than anybody waits."""


def main() -> None:
    """Run the targets that are named, or all; the exit code is 1 if one stumbled."""
    parser = argparse.ArgumentParser(
        prog="scripts/fuzz", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, default=MINUTES, help="of each target (30)")
    arguments = parser.parse_args()
    unknown = set(arguments.targets) - TARGETS.keys()
    if unknown:
        parser.error(
            f"{', '.join(sorted(unknown))}: no such target; there are {', '.join(TARGETS)}"
        )
    warnings.simplefilter("error")
    logging.disable()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))
    names = arguments.targets or list(TARGETS)
    stumbled = [name for name in names if not fuzz(name, 60.0 * arguments.minutes)]
    sys.exit(1 if stumbled else 0)


def fuzz(name: str, duration_s: float) -> bool:
    """Run a target for so long (s); return whether it survived everything."""
    target, began_s, files = TARGETS[name], time.monotonic(), 0
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() - began_s < duration_s:
            tried: list[bytes] = []
            try:
                _round(target, Path(folder), tried)
            except Exception:
                content = tried[-1]
                file = CORPUS / target.corpus / f"find-{hashlib.sha256(content).hexdigest()[:8]}"
                file.write_bytes(content)
                print(f"{name}: stumbled over {file}\n{traceback.format_exc()}", flush=True)
                return False
            files += len(tried)
    seconds = time.monotonic() - began_s
    print(f"{name}: survived {files} files in {seconds:.0f} s", flush=True)
    return True


def _round(target: Target, place: Path, tried: list[bytes]) -> None:
    """Give the target a number of files; the last one tried is the smallest it stumbles over."""
    seeds = target.seeds

    @seed(random.randrange(1 << 62))
    @settings(
        max_examples=ROUND,
        deadline=None,
        database=None,
        print_blob=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.sampled_from(seeds).flatmap(lambda content: target.changed(content, seeds)))
    def survives(content: bytes) -> None:
        tried.append(content)
        began_s = time.monotonic()
        survive(target, place, content)
        if time.monotonic() - began_s > SLOW_S:
            raise TookTooLongError

    survives()


if __name__ == "__main__":
    main()
