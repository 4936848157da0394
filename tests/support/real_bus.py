"""An ear on a real bus, and the wheel's own LCM tools."""

from pathlib import Path

import lcm
import pytest
from klab import alive

from koopman_lab.bus.channels import HEARTBEATS, ONBOARD_STATUS
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.eventlog.eventlog import read_events

MOST_WAITS = 600
WAIT_S = 0.05


def tool(name: str) -> str:
    """Return the binary of an LCM tool; the wheel's wrapper scripts swallow signals."""
    return str(Path(lcm.LCM_BIN_DIR) / name)


def other(url: str) -> str:
    """Return another bus than ``url``."""
    return url.replace("239.255.76.67", "239.255.76.68")


def config(url: str, robot_name: str = "R1"):
    return load_config(overrides=[f"bus.url={url}", f"robot.name={robot_name}"])


class Ear:
    """Hears who is alive."""

    def __init__(self, url, robot_name="R1"):
        self.url = url
        self.listener = Listener(config(url, robot_name))
        self.pids = {}
        self.status = None
        for name, channel in HEARTBEATS.items():
            self.listener.subscribe(channel, lambda m, name=name: self.pids.update({name: m.pid}))
        self.listener.subscribe(ONBOARD_STATUS, lambda m: setattr(self, "status", m))

    def wait(self, condition):
        silent = 0
        while not condition():
            silent += not self.listener.spin(WAIT_S)
            assert silent < MOST_WAITS, "did not happen in time"

    def wait_for(self, *names):
        self.wait(lambda: all(name in self.pids for name in names))
        return {name: self.pids[name] for name in names}

    def wait_until_gone(self, pids):
        for _ in range(MOST_WAITS):
            if not any(alive(pid) for pid in pids.values()):
                return
            # Nobody speaks any more: this waits without being an arbitrary sleep.
            self.listener.spin(WAIT_S)
        pytest.fail(f"still there: {[n for n, pid in pids.items() if alive(pid)]}")


def recorded(path: Path) -> dict[str, list[bytes]]:
    channels: dict[str, list[bytes]] = {}
    for event in read_events(path):
        channels.setdefault(event.channel, []).append(event.data)
    return channels
