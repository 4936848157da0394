"""A process that listens as ours do, for others to kill.

    python listening_process.py URL HOW [KEY]

HOW is ``one`` (a channel by name) or ``all``, KEY the file of the lab's key. It says "listening"
and why it is not filtered, and, as often as it hears the lab's e-stop, by how many kB its memory
has grown since the first one.
"""

import sys
from pathlib import Path

from koopman_lab.bus.channels import ESTOP
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config


def resident_kb() -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def say(text: object) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main(url: str, how: str, *key_files: str) -> None:
    keys = [f"bus.key_file={file}" for file in key_files]
    listener = Listener(load_config(overrides=[f"bus.url={url}", *keys]))
    if how == "all":
        listener.overhear(lambda *_: None)
    heard_kb: list[int] = []

    def hear(_: object) -> None:
        heard_kb.append(resident_kb())
        say(heard_kb[-1] - heard_kb[0])

    listener.subscribe(ESTOP, hear)
    say(f"listening {listener.filter_fault()!r}")
    while True:
        listener.spin(1.0)


if __name__ == "__main__":
    main(*sys.argv[1:])
