"""What the page is told of who may speak: it comes with every snapshot."""

import json
import os
import re
import subprocess

import pytest
from klab import KLAB
from websockets.sync.client import connect

import lcmtypes
from koopman_lab.bus.channels import ONBOARD_STATUS
from koopman_lab.bus.lab_key import fingerprint, write_new_key
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config

LIMIT_S = 20.0
MOST_TRIES = 200
URL = f"bus.url={os.environ['LCM_DEFAULT_URL']}"


@pytest.fixture(params=["key", "no key"])
def page(request, tmp_path):
    """Serve the page with a key or without; give its socket and the key."""
    key, options = None, ()
    if request.param == "key":
        key = write_new_key(tmp_path / "lab.key")
        options = ("--set", f"bus.key_file={tmp_path / 'lab.key'}")
    process = subprocess.Popen(
        [*KLAB, "view", "--set", URL, "--port", "0", *options], stderr=subprocess.PIPE, text=True
    )
    try:
        address = re.search(r"http://(\S+)", process.stderr.readline()).group(1)
        with connect(f"ws://{address}ws", max_size=None) as socket:
            yield socket, key
    finally:
        process.terminate()
        process.communicate(timeout=60)


def test_it_says_who_may_speak_and_names_who_lacks_the_key(page):
    socket, key = page
    stranger = Listener(load_config(overrides=[URL]))
    status, refusals, robots = lcmtypes.onboard_status_t(), "", {}
    for _ in range(MOST_TRIES):
        status.utime = stranger.now_us()
        stranger.publish(ONBOARD_STATUS, status)
        message = json.loads(socket.recv(LIMIT_S))
        who, refusals = message["trust"]
        robots = message["robots"]
        if refusals or robots:
            break
    if key is None:
        assert "whoever can reach this bus can drive the robot" in who
        assert (refusals, set(robots)) == ("", {"R1"})
    else:
        assert fingerprint(key) in who
        assert "R1_ONBOARD_STATUS (" in refusals
        assert robots == {}
