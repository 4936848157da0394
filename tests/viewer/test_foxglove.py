"""The live server: a client that speaks Foxglove's protocol, written from its specification."""

import contextlib
import json
import re
import signal
import struct
import subprocess

import pytest
from foxglove import Context
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from klab import KLAB, klab
from real_bus import config
from websockets.sync.client import connect

import lcmtypes
from koopman_lab.bus.channels import ESTOP, MOCAP_POSE
from koopman_lab.bus.realtime import Listener
from offboard.monitor.lab_view import MOST_ROBOTS
from offboard.terminal.exit_codes import ExitCode
from offboard.viewer.foxglove_feed import FoxgloveFeed

LIMIT_S = 20.0
MOST_TRIES = 3000
MESSAGE_DATA = 1
"""Opcode of a binary frame: number of the subscription, time (ns), message."""


@pytest.fixture
def served(bus_url):
    process = subprocess.Popen(
        [*KLAB, "foxglove", "--port", "0", "--url", bus_url], stderr=subprocess.PIPE, text=True
    )
    yield process, re.search(r"ws://\S+", process.stderr.readline()).group()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130


class Client:
    """Subscribes to topics as Foxglove does."""

    def __init__(self, address, bus_url):
        self.socket = connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None)
        self.bus = Listener(config(bus_url))
        self.bus.subscribe(ESTOP, lambda _: None)
        self.channels, self.heard, self.topics = {}, {}, {}

    def speak(self):
        pose = lcmtypes.mocap_pose_t()
        pose.utime, pose.tracking_valid = self.bus.now_us(), True
        pose.x1_m, pose.x2_m, pose.theta_rad = 0.25, -0.5, 0.0
        self.bus.publish(MOCAP_POSE, pose)
        self.bus.spin(0.01)

    def until(self, condition):
        for _ in range(MOST_TRIES):
            self.speak()
            with contextlib.suppress(TimeoutError):
                while True:  # all that one pose brought, and no more
                    self._take(self.socket.recv(0.02))
            if condition():
                return
        pytest.fail("never happened")

    def _take(self, frame):
        if isinstance(frame, str):
            message = json.loads(frame)
            if message["op"] == "advertise":
                for channel in message["channels"]:
                    self._subscribe(channel)
            # foxglove-sdk 0.30.3 announces a channel a moment before it knows it: who answers at
            # once is refused, and asks again.
            unknown = re.fullmatch(r"Unknown channel ID: (\d+)", message.get("message", ""))
            for channel in list(self.channels.values()):
                if unknown is not None and channel["id"] == int(unknown[1]):
                    self._subscribe(channel)
        elif frame[0] == MESSAGE_DATA:
            number, time_ns = struct.unpack_from("<IQ", frame, 1)
            self.heard.setdefault(self.topics[number], []).append((time_ns, frame[13:]))

    def _subscribe(self, channel):
        self.channels[channel["topic"]] = channel
        number = len(self.topics)
        self.topics[number] = channel["topic"]
        wanted = {"id": number, "channelId": channel["id"]}
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))


def test_who_opens_the_lab_late_sees_all_of_it(served, bus_url):
    client = Client(served[1], bus_url)
    with client.socket:
        client.until(lambda: {"/tf", "/R1/pose", "/R1/scene", "R1_MOCAP_POSE"} <= set(client.heard))
        schemas = {topic: channel["schemaName"] for topic, channel in client.channels.items()}
        assert schemas["/tf"] == "foxglove.FrameTransform"
        assert schemas["/R1/scene"] == "foxglove.SceneUpdate"
        assert client.channels["/tf"]["encoding"] == "protobuf"
        before_us = client.bus.now_us()
        client.until(lambda: client.heard["/tf"][-1][0] > before_us * 1000)
        transform = FrameTransform.FromString(client.heard["/tf"][-1][1])
        assert (transform.parent_frame_id, transform.child_frame_id) == ("lab", "R1")
        assert (transform.translation.x, transform.translation.y) == (0.25, -0.5)
        drawn = {
            entity.id
            for _, data in client.heard["/R1/scene"]
            for entity in SceneUpdate.FromString(data).entities
        }
        assert {"R1 body", "R1 floor", "R1 X0", "R1 Z"} <= drawn
        values = json.loads(client.heard["R1_MOCAP_POSE"][-1][1])
        assert values["x1_m"] == 0.25
    # A second client comes when all has long been said.
    late = Client(served[1], bus_url)
    with late.socket:
        late.until(lambda: "/R1/scene" in late.heard)


def test_a_port_that_is_taken_is_said_in_words(served, bus_url):
    port = served[1].rpartition(":")[2]
    done = klab("foxglove", "--port", port, "--url", bus_url)
    assert done.returncode == ExitCode.LAB_FAILURE
    assert f"--port {port}: cannot listen there" in done.stderr
    assert "Traceback" not in done.stderr


def test_who_invents_robots_and_configurations_endlessly_fills_no_memory_and_takes_no_time():
    feed, pose, info = FoxgloveFeed(Context()), lcmtypes.mocap_pose_t(), lcmtypes.session_info_t()
    pose.tracking_valid = True
    for number in range(3 * MOST_ROBOTS):
        feed.take(f"X{number}_MOCAP_POSE", pose.encode(), number)
    assert len(feed._scene._robots) == MOST_ROBOTS
    for number in range(100):
        info.config_yaml = f"seed: {number}"
        feed.take("X0_SESSION_INFO", info.encode(), 10_000_000 + number)
    assert feed._scene._robots["X0"]._config_yaml == "seed: 0"
