"""Robot and cameras of the plant, each without the other."""

import math

import lcm
from klab import start_klab
from tests_support import lab_of

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.bus.realtime import Listener
from koopman_lab.config.load import load_config
from koopman_lab.units import US_PER_S
from offboard.logger.node import LoggerNode
from offboard.sampler.node import SamplerNode
from onboard.motor_loop.node import OnboardNode
from onboard.plant.cameras.node import SimulatedCameras
from onboard.plant.node import PlantNode
from onboard.plant.simulated_robot import SimulatedRobot


class CameraBridge:
    """Cameras of another make: a frame for each PLANT_TRUTH, without a marker's offset."""

    name = "bridge"

    def attach(self, port):
        self._port = port
        port.subscribe(channels.PLANT_TRUTH, self._on_truth)

    def _on_truth(self, truth):
        frame = lcmtypes.mocap_pose_t()
        frame.utime, frame.tracking_valid = truth.utime, True
        frame.x1_m, frame.x2_m, frame.theta_rad = truth.x1_m, truth.x2_m, truth.theta_rad
        self._port.publish(channels.MOCAP_POSE, frame)

    def close(self):
        pass


def test_a_session_with_the_cameras_of_somebody_else(tmp_path):
    small = ["sampler.segments_per_basis=1", "sampler.largest_steps=20", "mocap.rate_hz=100"]
    config = load_config(overrides=small)
    log, sampler = tmp_path / "session.lcm", SamplerNode(config)
    robot = PlantNode(config, cameras=False), CameraBridge(), OnboardNode(config)
    lab = lab_of(config, *robot, LoggerNode(config, log), sampler)
    assert lab.run(300.0)
    lab.close()
    assert sampler.outcome().complete
    poses, truths = {}, {}
    for event in lcm.EventLog(str(log), "r"):
        if event.channel == "R1_MOCAP_POSE":
            frame = lcmtypes.mocap_pose_t.decode(event.data)
            poses[frame.utime] = frame.x1_m, frame.x2_m, frame.theta_rad
        elif event.channel == "R1_PLANT_TRUTH":
            truth = lcmtypes.plant_truth_t.decode(event.data)
            truths[truth.utime] = truth.x1_m, truth.x2_m, truth.theta_rad
    assert len(poses) > 1000
    assert poses == truths


class Circle:
    """Goes round at 1 m from the origin, once in ten seconds."""

    def __init__(self):
        self.after_tick = []

    def look(self, now_us):
        angle = math.tau * now_us / (10.0 * US_PER_S)
        return now_us, (math.cos(angle), math.sin(angle), 0.0), angle > math.tau / 2


def test_the_cameras_see_whatever_they_look_at():
    config = load_config(preset="ideal")
    lab, heard = Lockstep(config), []
    lab.add(SimulatedCameras(config, Circle()))
    lab.add(ear := Ear(heard))
    lab.run(7.0)
    assert ear.name
    assert len(heard) == 7 * 240 + 1
    for frame in heard:
        angle = math.tau * frame.utime / (10.0 * US_PER_S)
        assert frame.tracking_valid == (angle <= math.tau / 2)
        if frame.tracking_valid:
            assert (frame.x1_m, frame.x2_m) == (math.cos(angle), math.sin(angle))


class Ear:
    """Hears the cameras."""

    name = "logger"

    def __init__(self, heard):
        self._heard = heard

    def attach(self, port):
        port.subscribe(channels.MOCAP_POSE, self._heard.append)

    def close(self):
        pass


def test_the_robot_alone_speaks_of_its_wheels_and_its_truth_only():
    config, spoken = load_config(), set()
    lab = Lockstep(config)
    lab.add(SimulatedRobot(config))

    class All:
        name = "logger"

        def attach(self, port):
            for channel in channels.CHANNELS:
                port.subscribe_raw(channel, lambda name, *_: spoken.add(name))

        def close(self):
            pass

    lab.add(All())
    lab.run(1.0)
    assert spoken == {
        *("R1_ENCODER", "R1_PLANT_TRUTH", "R1_PLANT_HEARTBEAT", "R1_LOGGER_HEARTBEAT"),
    }


def test_over_udp_the_command_leaves_the_cameras_to_somebody_else(bus_url):
    """Who hears MOCAP_POSE then hears one speaker only."""
    listener, poses, truths = Listener(load_config(overrides=[f"bus.url={bus_url}"])), [], []
    listener.subscribe(channels.MOCAP_POSE, poses.append)
    listener.subscribe(channels.PLANT_TRUTH, truths.append)
    plant = start_klab("run", "plant", "--without-cameras", "--url", bus_url)
    try:
        silent = 0
        while len(truths) < 100:
            silent += not listener.spin(0.1)
            assert silent < 300, "did not happen in time"
            frame = lcmtypes.mocap_pose_t()
            frame.utime = listener.now_us()
            listener.publish(channels.MOCAP_POSE, frame)
    finally:
        plant.terminate()
        plant.wait()
        plant.stdout.close()
    assert poses
    assert [frame.sequence for frame in poses] == list(range(len(poses)))
