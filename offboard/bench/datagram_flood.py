"""A flood of mutated datagrams: `python -m offboard.bench.datagram_flood URL ROBOT SECONDS SHARE`.

It sends within this machine only, whatever the URL says, and ends by itself; then it prints how
many datagrams it sent, and in what time (s), as JSON.
"""

from __future__ import annotations

import json
import random
import socket
import sys
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

from offboard.bench.mutated_datagrams import lab_messages, mutated, short_message

STRANGER = "R0"
"""Whose messages are mutated. One that stays sound is no order to the lab's robot."""
MOST_DATAGRAMS = 200_000_000
BATCH = 500
DEFAULT_PORT = 7667


def datagrams(robot_name: str, heard_share: float, seed: int) -> Iterator[bytes]:
    """Return datagrams without end, of which a share is on a robot's channels and no message.

    Those pass every filter, and reach the handlers of the lab. The others are mutated.
    """
    draw, strange = random.Random(seed), mutated(STRANGER, seed)
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
    began_s = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.connect((parts.hostname, parts.port or DEFAULT_PORT))
        while passed_s < seconds and count < MOST_DATAGRAMS:
            for _ in range(BATCH):
                sender.send(next(stream))
            count += BATCH
            passed_s = time.monotonic() - began_s
    return count, passed_s


if __name__ == "__main__":
    url, robot_name, *numbers = sys.argv[1:]
    sys.stdout.write(json.dumps(flood(url, robot_name, *map(float, numbers))))
