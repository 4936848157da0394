"""An ear on a real bus, a stranger there beside a robot, and the wheel's own LCM tools."""

from pathlib import Path

import lcm
import pytest
from klab import alive, klab, start_klab

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.channels import HEARTBEATS, ONBOARD_STATUS
from koopman_lab.bus.commanders import commander_number
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.eventlog.eventlog import read_events
from koopman_lab.units import US_PER_S

MOST_WAITS = 600
WAIT_S = 0.05
LIMIT_S = 120.0
"""On a bus that is never silent, where no count of waits ends."""


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
        silent, end_us = 0, self.listener.now_us() + LIMIT_S * US_PER_S
        while not condition():
            silent += not self.listener.spin(WAIT_S)
            in_time = silent < MOST_WAITS and self.listener.now_us() < end_us
            assert in_time, "did not happen in time"

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


STATUS = lcmtypes.onboard_status_t
SENDINGS = 150
"""Of a hundred messages a second."""
LOOK_S = 0.01
PID, MANY = 4711, 1_000_000


class Stranger:
    """A program on the bus that has LCM and the types of messages, and no key."""

    def __init__(self, url):
        self._bus = lcm.LCM(url)

    def publish(self, channel, message):
        """Send a message as it is, with whatever number."""
        self._bus.publish(channel.name("R1"), message.encode())


class StrangersLab:
    """A robot whose processes have the key or none, a witness of its truth, and a stranger."""

    def __init__(self, url, options):
        self.options = options
        overrides = [word for word in options if word != "--set"]
        config = load_config(overrides=[f"bus.url={url}", *overrides])
        self.holder = Listener(config)
        """Speaks with the key, if there is one."""
        self.stranger = Stranger(url)
        self.status = None
        self.poses = []
        self.holder.subscribe(channels.ONBOARD_STATUS, self._on_status)
        self.holder.subscribe(channels.PLANT_TRUTH, self._on_truth)
        self._truth_us = 0
        self.processes = []

    def _on_status(self, status):
        self.status = status

    def _on_truth(self, truth):
        if truth.utime > self._truth_us:  # what a log said of it was true then
            self._truth_us = truth.utime
            self.poses.append((truth.x1_m, truth.x2_m))

    def start(self, *names):
        self.processes += [
            start_klab("run", name, "--preset", "lab", *self.options) for name in names
        ]

    def start_robot(self):
        self.start("plant", "onboard")
        self.wait(lambda: self.poses and self.status and self.status.state == STATUS.REST)

    def wait(self, condition):
        for _ in range(6000):
            if condition():
                return
            self.holder.spin(LOOK_S)
        pytest.fail("did not happen in time")

    def say(self, *messages):
        """Have each message, made anew, said so often while the robot is watched."""
        for k in range(SENDINGS):
            for speaker, channel, make in messages:
                message = make(k)
                speaker.publish(channel, message)
            self.watch(LOOK_S)

    def watch(self, seconds):
        end_us = self.holder.now_us() + seconds * US_PER_S
        while (left_us := end_us - self.holder.now_us()) > 0:
            self.holder.spin(left_us / US_PER_S)

    def moved_m(self):
        x1, x2 = self.poses[0]
        return max(((x - x1) ** 2 + (y - x2) ** 2) ** 0.5 for x, y in self.poses)

    def klab(self, *words):
        return klab(*words, *self.options)

    def close(self):
        for process in self.processes:
            process.terminate()
            process.communicate(timeout=60)


HOLDER = commander_number("controller", PID)


def commands(lab, speed):
    """Return commands of the holder's number; a stranger counts on ahead of the holder."""

    def make(k):
        message = lcmtypes.velocity_command_t()
        message.utime, message.commander = lab.holder.now_us(), HOLDER
        is_held = lab.status.commander == HOLDER
        message.intent = message.CONTINUE if is_held else message.BEGIN
        message.v_m_per_s, message.sequence = speed, MANY + k  # of the holder's its port counts
        return message

    return make
