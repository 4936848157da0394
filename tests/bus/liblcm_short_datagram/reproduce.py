"""Send datagrams to a process that listens with liblcm, and say what became of it.

    python reproduce.py                          # 8 bytes, behind what is left in the buffer
    python reproduce.py 4c43303200000000580061   # any others, each in hexadecimal; this is sound

Needs the Python package lcm and a multicast route; nothing leaves the machine (ttl=0). The exit
code is 0 if the process that listened lives, 1 if it died.
"""

import os
import signal
import socket
import subprocess
import sys

CHANNEL = b"X"
LEFT_IN_THE_BUFFER = bytes(8) + CHANNEL + b"\0"
"""No datagram of LCM: dropped, and its bytes stay where the next one is received."""
SHORTEST = b"LC02" + bytes(4)
MESSAGE = SHORTEST + CHANNEL + b"\0" + b"hello"

GROUP, PORT = "239.255.76.67", 7000 + os.getpid() % 500
LISTEN = """
import lcm, sys
bus = lcm.LCM(sys.argv[1])
bus.subscribe("X", lambda channel, data: print(len(data), flush=True))
print("listening", flush=True)
while True:
    bus.handle()
"""


def end_of_listener(datagrams: list[bytes]) -> int | None:
    """Return the exit code of a process that was sent them; None if it lives."""
    command = [sys.executable, "-c", LISTEN, f"udpm://{GROUP}:{PORT}?ttl=0"]
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as listener,
    ):
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.connect((GROUP, PORT))
        lines = iter(listener.stdout.readline, b"")
        assert next(lines) == b"listening\n"
        for datagram in datagrams:
            sender.send(datagram)
        sender.send(MESSAGE)
        # The message behind them arrives, or the process is gone and its output ends.
        lives = b"5\n" in lines
        if lives:
            listener.kill()
    return None if lives else listener.returncode


if __name__ == "__main__":
    sent = [bytes.fromhex(text) for text in sys.argv[1:]] or [LEFT_IN_THE_BUFFER, SHORTEST]
    code = end_of_listener(sent)
    how = "lives" if code is None else f"died: {signal.Signals(-code).name}"
    sys.stdout.write(f"after {' and '.join(map(repr, sent))} the process {how}\n")
    sys.exit(code is not None)
