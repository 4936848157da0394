"""A standing robot in lockstep, and a node that listens to it as one that drives does."""

import lcmtypes
from koopman_lab.bus import channels
from koopman_lab.bus.lockstep import Lockstep
from koopman_lab.config.load import load_config
from offboard.desk.commander import Commands
from offboard.desk.drive_inputs import DriveInputs
from offboard.desk.guard import Guard

STATUS = lcmtypes.onboard_status_t


class Speakers:
    """Cameras, board and logger of a standing robot, each of which can be changed or silenced."""

    name = "plant"

    def __init__(self):
        self.rate_hz, self.twice, self.valid, self.numbered = 240, False, True, True
        self.ahead_us, self.silent, self.stuck_us = 0, set(), None
        self.status = STATUS()
        self.frames = self.logged_bytes = 0
        self.stray = []
        """Frames to say once, after those of a step."""
        self.off_us = {}
        """By channel: how far its stamps are ahead."""

    def attach(self, port):
        self.port = port
        port.every(20.0, self.speak)

    def close(self):
        pass

    def speak(self, now_us):
        for k in range(self.rate_hz // 20):
            pose = lcmtypes.mocap_pose_t()
            pose.utime = now_us - 50_000 + round(k * 1e6 / self.rate_hz) + self.ahead_us
            pose.x1_m, pose.tracking_valid = 0.3 + 1e-5 * (self.frames % 7), self.valid
            self.frames += 1
            for _ in range(2 if self.twice else 1):
                self.say(channels.MOCAP_POSE, pose)
        while self.stray:
            self.say(channels.MOCAP_POSE, self.stray.pop())
        wheels = lcmtypes.wheel_state_t()
        wheels.utime = now_us - 25_000 + self.off_us.get(channels.WHEEL_STATE.suffix, 0)
        self.say(channels.WHEEL_STATE, wheels)
        self.status.utime = now_us if self.stuck_us is None else self.stuck_us
        self.status.utime += self.off_us.get(channels.ONBOARD_STATUS.suffix, 0)
        self.say(channels.ONBOARD_STATUS, self.status)
        logger = lcmtypes.logger_status_t()
        logger.utime = now_us + self.off_us.get(channels.LOGGER_STATUS.suffix, 0)
        logger.bytes = self.logged_bytes
        self.say(channels.LOGGER_STATUS, logger)

    def say(self, channel, message):
        if channel.suffix not in self.silent:
            self.port.publish(channel, message)


class Driver:
    """A node that only listens, and keeps what it is told."""

    name = "controller"

    def __init__(self, config, *, records):
        self.config, self.records = config, records
        self.told = []

    def attach(self, port):
        guard = Guard(self.config, 0.5)
        self.inputs = DriveInputs(
            port, self.config, guard, Commands(port, self.config, self.name), records=self.records
        )
        port.every(20.0, self.tick)
        port.subscribe(
            channels.INTERLOCK, lambda m: self.told.append((m.utime, m.reason, m.lasting))
        )
        self.port = port

    def close(self):
        pass

    def tick(self, now_us):
        assert now_us == self.port.now_us()
        self.inputs.step(now_us, driving=False)


class Bench:
    def __init__(self, *, records=True):
        config = load_config(robot="kinematic")
        self.speakers, self.driver = Speakers(), Driver(config, records=records)
        self.lab = Lockstep(config, start_us=10_000_000, process=100)
        self.lab.add(self.speakers)
        self.lab.add(self.driver)

    def after(self, seconds):
        self.lab.run(seconds)
        return self.driver.inputs.interlock
