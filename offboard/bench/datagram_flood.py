"""A flood of mutated datagrams: `python -m offboard.bench.datagram_flood URL ROBOT SECONDS SHARE`.

It sends within this machine only, whatever the URL says, and ends by itself, or at SIGTERM; then it
prints how many datagrams it sent, and in what time (s), as JSON.
"""

from __future__ import annotations

import json
import random
import signal
import socket
import sys
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

from offboard.bench.mutated_datagrams import lab_messages, mutated, short_message

STRANGER = "X{}"
"""Whose messages are mutated. One that stays sound is no order to the lab's robot, which no single
mutation makes of this name."""
MOST_DATAGRAMS = 200_000_000
BATCH = 500
DEFAULT_PORT = 7667


def datagrams(robot_name: str, heard_share: float, seed: int) -> Iterator[bytes]:
    """Return datagrams without end, of which a share is on a robot's channels and no message.

    Those pass every filter, and reach the handlers of the lab. The others are mutated.
    """
    draw, strange = random.Random(seed), mutated(STRANGER.format(robot_name), seed)
    messages = lab_messages(robot_name)
    while True:
        if draw.random() < heard_share:
            name, payload = draw.choice(messages)
            yield short_message(name, draw.randbytes(len(payload)))
        else:
            yield next(strange)


def flood(url: str, robot_name: str, seconds: float, heard_share: float) -> tuple[int, float]:
    """Send as fast as this process can; return how many datagrams, and in what time (s)."""
    parts = urlsplit(url)
    stream, count, passed_s = datagrams(robot_name, heard_share, seed=1), 0, 0.0
    ends: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ends.append(number))
    began_s = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.connect((parts.hostname, parts.port or DEFAULT_PORT))
        while passed_s < seconds and count < MOST_DATAGRAMS and not ends:
            for _ in range(BATCH):
                sender.send(next(stream))
            count += BATCH
            passed_s = time.monotonic() - began_s
    return count, passed_s


if __name__ == "__main__":
    url, robot_name, *numbers = sys.argv[1:]
    sys.stdout.write(json.dumps(flood(url, robot_name, *map(float, numbers))))
