"""Clients of the page without a page: `python -m offboard.bench.page_clients HOST:PORT N`.

At SIGINT they print, for each client, when each snapshot came (s) and how old it was (ms).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import sys
import time

from websockets.asyncio.client import connect

TRY_S = 0.2


async def look(address: str, seen: list[tuple[float, float]]) -> None:
    """Read snapshots for good; the server may still be starting."""
    while True:
        with contextlib.suppress(OSError):
            async with connect(f"ws://{address}/ws", max_size=None) as socket:
                async for text in socket:
                    message = json.loads(text)
                    if "now_us" in message:
                        now_s = time.time()
                        age_ms = now_s * 1e3 - message["now_us"] * 1e-3
                        seen.append((round(now_s, 4), round(age_ms, 2)))
        await asyncio.sleep(TRY_S)


async def main(address: str, count: int) -> None:
    """Look until SIGINT, then print."""
    seen: list[list[tuple[float, float]]] = [[] for _ in range(count)]
    over = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, over.set)
    tasks = [asyncio.create_task(look(address, client_seen)) for client_seen in seen]
    await over.wait()
    for task in tasks:
        task.cancel()
    sys.stdout.write(json.dumps(seen))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
