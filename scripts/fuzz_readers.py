"""Give damaged files to the readers of files for some minutes each; keep what they stumble over.

Files are drawn by hypothesis from the corpus of each target, tests/fuzz_corpus; the targets stand
in tests/support/fuzzing/targets.py. A find is made as small as it gets and written into the corpus.
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

from fuzzing.targets import CORPUS, TARGETS, Target, survive
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

MINUTES = 30.0
ROUND = 200
"""Files between two looks at the clock."""
SLOW_S = 2.0
"""A file that takes longer is a find, too."""
PLACES = 6
"""Of a traceback that are shown, the last ones."""
MOST_MEMORY_BYTES = 4 << 30


class StumbledError(Exception):
    """Something else than an expected mistake left a reader, or it took too long."""


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
            except StumbledError as error:
                content = tried[-1]
                file = CORPUS / target.corpus / f"find-{hashlib.sha256(content).hexdigest()[:8]}"
                file.write_bytes(content)
                cause = error.__cause__ or error
                places = "".join(traceback.format_tb(cause.__traceback__)[-PLACES:])
                print(
                    f"{name}: stumbled over {file}\n{places}{type(cause).__name__}: {cause}"[:5000]
                )
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
    @given(st.integers(0, len(seeds) - 1).flatmap(lambda k: target.changed(seeds[k], seeds)))
    def survives(content: bytes) -> None:
        tried.append(content)
        began_s = time.monotonic()
        try:
            survive(target, place, content)
        except Exception as error:
            raise StumbledError from error
        if time.monotonic() - began_s > SLOW_S:
            raise StumbledError(f"took longer than {SLOW_S:g} s")

    survives()


if __name__ == "__main__":
    main()
