"""How snapshots are handed out, at the server's own interface to the network."""

import asyncio
import json

import pytest

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from offboard.viewer.guard import Guard
from offboard.viewer.operator_desk import OperatorDesk
from offboard.viewer.server import SNAPSHOT_S, Server

LIMIT_S = 20.0
SNAPSHOTS = 12


class Client:
    """A page as the network shows it to the server; it takes nothing while its gate is shut."""

    def __init__(self, server):
        self.gate, self.got = asyncio.Event(), asyncio.Queue()
        self.begun = 0
        self._first = True
        scope = {
            **{"type": "websocket", "path": "/ws", "raw_path": b"/ws", "query_string": b""},
            **{"headers": [(b"host", b"127.0.0.1")], "root_path": "", "scheme": "ws"},
            **{"subprotocols": [], "asgi": {"version": "3.0"}},
        }
        self._task = asyncio.create_task(server.app(scope, self._receive, self._send))

    async def _receive(self):
        if self._first:
            self._first = False
            return {"type": "websocket.connect"}
        return await asyncio.Event().wait()

    async def _send(self, message):
        if message["type"] != "websocket.send":
            return
        self.begun += 1
        await self.gate.wait()
        self.got.put_nowait(json.loads(message["text"]))

    async def snapshots(self, count):
        return [await asyncio.wait_for(self.got.get(), LIMIT_S) for _ in range(count)]

    async def leave(self):
        self._task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await self._task


def test_a_client_that_does_not_read_holds_nobody_up_and_then_gets_the_newest(bus_url):
    async def story():
        config = load_config(overrides=[f"bus.url={bus_url}"])
        desk, mouth = OperatorDesk(config), Listener(config)
        server = Server(desk, Guard(None), print)
        async with server.app.router.lifespan_context(server.app):
            slow, reader = Client(server), Client(server)
            reader.gate.set()
            for _ in range(SNAPSHOTS):
                pose = lcmtypes.mocap_pose_t()
                pose.utime = mouth.now_us()
                mouth.publish(MOCAP_POSE, pose)
                taken = (await reader.snapshots(1))[0]
            # Of all that went by, one snapshot waits for it, and no queue grows.
            assert slow.begun == 1
            slow.gate.set()
            old, new = await slow.snapshots(2)
            assert old["now_us"] < taken["now_us"] <= new["now_us"]
            assert new["robots"]["R1"]["pose"] == [0.0, 0.0, 0.0]
            for client in (slow, reader):
                await client.leave()

    asyncio.run(story())


def test_every_page_gets_every_row_once_however_slowly_it_reads(bus_url):
    async def story():
        config = load_config(overrides=[f"bus.url={bus_url}"])
        desk = OperatorDesk(config)
        server = Server(desk, Guard(None), print)
        pose, step_us = lcmtypes.mocap_pose_t(), round(SNAPSHOT_S * 1e6)
        async with server.app.router.lifespan_context(server.app):
            reader, slow = Client(server), Client(server)
            reader.gate.set()
            for k in range(SNAPSHOTS + 1):  # each but the first ends a row
                desk.view.take("R1_MOCAP_POSE", pose.encode(), k * step_us)
                await reader.snapshots(1)
            slow.gate.set()
            numbers = []
            for message in await slow.snapshots(3):
                rows = message["news"]["R1"]["rows"] if message["news"] else None
                if rows is not None:
                    numbers += range(rows["begin"], rows["begin"] + len(rows["items"]))
            assert numbers == list(range(SNAPSHOTS))
            for client in (slow, reader):
                await client.leave()

    asyncio.run(story())
