"""With a key configured, lockstep says the very same bytes: nobody can break into one process."""

from tests_support import Script, lab_of

from koopman_lab.bus import channels
from koopman_lab.bus.lab_key import write_new_key
from koopman_lab.config.load import load_config
from onboard.motor_loop.node import OnboardNode
from onboard.plant.node import PlantNode


class Recorder:
    """Keeps every message."""

    name = "recorder"

    def __init__(self):
        self.heard = []

    def attach(self, port):
        for channel in channels.all_channels():
            port.subscribe_raw(channel, lambda *message: self.heard.append(message))
        port.every(1.0, lambda _: None)

    def close(self):
        pass


def said(**bus):
    config = load_config(overrides=[f"bus.{key}={value}" for key, value in bus.items()])
    recorder = Recorder()
    nodes = PlantNode(config), OnboardNode(config), Script(config, (0.2, 0.1)), recorder
    lab = lab_of(config, *nodes)
    lab.run(2.0)
    lab.close()
    return recorder.heard


def test_the_same_bytes_with_and_without_a_key(tmp_path):
    write_new_key(tmp_path / "lab.key")
    without = said()
    assert len(without) > 500
    assert said(key_file=tmp_path / "lab.key") == without
