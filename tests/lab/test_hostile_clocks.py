"""Every channel says every hostile time while a robot drives: judged by the plant's truth.

The robot drives on, or stops and somebody says why; it is never blind, and the controller's work
stays what it was.
"""

import math

import pytest
from hostile.times import HOSTILE

from koopman_lab.bus.channels import CHANNELS, MOCAP_POSE, MPC_STATE
from koopman_lab.bus.header import restamp
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from offboard.bench.faults.stage import Stage, is_at_rest, rolled_m
from offboard.bench.faults.strikes import Inject
from offboard.controller.input_history import MEMORY_S, InputHistory
from offboard.desk.floor import Floor, excess_m

ROBOT = pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
DAY_S = 86_400.0


class Tap:
    """Keeps the newest message of every channel, and when the controller spoke."""

    name = "tap"

    def __init__(self):
        self.newest = {}
        self.stepped_us = []

    def attach(self, port):
        for channel in CHANNELS:
            port.subscribe_raw(channel, self.hear)

    def close(self):
        """Nothing is held."""

    def hear(self, name, data, arrived_us):
        self.newest[name] = data
        if name == MPC_STATE.name("R1"):
            self.stepped_us.append(arrived_us)


@pytest.fixture
def pieces(monkeypatch):
    """Count the pieces of every walk over past inputs, and allow no more than 5 s of them."""
    walks, between = [], InputHistory.between

    def counted(self, start_us, end_us, longest_s):
        walk = 0
        for piece in between(self, start_us, end_us, longest_s):
            walk += 1
            assert walk <= MEMORY_S / longest_s + len(self._times) + 2
            yield piece
        walks.append(walk)

    monkeypatch.setattr(InputHistory, "between", counted)
    return walks


def stage_of(robot, folder, activity="park", wrong=(), **overrides):
    config = load_config(
        robot=robot,
        overrides=["controller.horizon=20", *(f"{k}={v}" for k, v in overrides.items())],
    )
    stage = Stage(config, activity, folder / "session.lcm", wrong)
    stage.join(tap := Tap())
    return stage, tap


def say(stage, tap, channel, what):
    """Let somebody say the newest message of a channel once more, with another time."""
    name = channel.name("R1")
    data = tap.newest.get(name) or channel.type().encode()
    now_us = stage.lab.now_us
    stamp = max(-(2**63), min(2**63 - 1, HOSTILE[what](now_us)))
    stage.lab.send(name, restamp(data, stamp))


def judge_motion(stage, since_us=0):
    """Nothing leaves the floor, and who has ended or waits stands."""
    sights = [sight for sight in stage.witness.sights if sight.utime >= since_us]
    fastest = max(abs(sight.v_m_per_s) for sight in sights)
    beyond = max(excess_m(stage.config.floor, sight.x1_m, sight.x2_m) for sight in sights)
    assert beyond <= Floor(stage.config).braking_m(fastest)
    if stage.ended_us is not None and stage.lab.now_us - stage.ended_us > 2_000_000:
        assert is_at_rest(sights[-1])
        assert stage.message


@ROBOT
@pytest.mark.parametrize("channel", CHANNELS, ids=lambda channel: channel.suffix)
def test_one_channel_says_every_hostile_time_while_the_robot_drives(
    robot, channel, tmp_path, pieces
):
    stage, tap = stage_of(robot, tmp_path)
    stage.until_fast()
    for what in HOSTILE:
        say(stage, tap, channel, what)
        stage.run(0.1)
    began_us = stage.lab.now_us
    stage.run(4.0)
    judge_motion(stage)
    assert max(pieces) <= MEMORY_S / stage.config.controller.dt_s + 102
    # The controller went on to think, 20 times a second, until it was done.
    end_us = stage.ended_us or stage.lab.now_us
    steps = [t for t in tap.stepped_us if began_us <= t <= end_us]
    assert len(steps) >= (end_us - began_us) * 20e-6 - 2
    stage.close()


@ROBOT
@pytest.mark.parametrize("what", HOSTILE)
def test_one_camera_frame_of_another_time_is_dropped_and_the_robot_parks(
    robot, what, tmp_path, pieces
):
    stage, tap = stage_of(robot, tmp_path)
    stage.until_fast()
    say(stage, tap, MOCAP_POSE, what)
    stage.run(25.0)
    assert stage.message == "parked"
    drive = stage.commander.controller
    # A stamp within what is plausible hides those before it for no longer than it lies ahead.
    assert sum(pause.duration_s for pause in drive.pauses) <= 1.0
    assert math.hypot(*drive.pose()[:2]) < 0.05
    judge_motion(stage)
    assert pieces
    stage.close()


@ROBOT
@pytest.mark.parametrize("jump_s", [-DAY_S, 3600.0, 1e9, -1e9])
def test_cameras_of_another_day_stop_the_robot_within_the_guards_time_and_are_named(
    robot, jump_s, tmp_path, pieces
):
    stage, tap = stage_of(robot, tmp_path)
    stage.until_fast()
    struck_us = stage.lab.now_us
    Inject(Fault(kind="camera_clock", jump_s=jump_s))(stage)
    settings, limits = stage.config.controller, stage.config.motor_loop.limits
    blind_s = settings.tracking_timeout_s + 0.2
    stands_s = blind_s + limits.v_m_per_s / limits.a_m_per_s2 + 0.5
    stage.run(stands_s)
    assert is_at_rest(stage.witness.sights[-1])
    since = [sight for sight in stage.witness.sights if sight.utime >= struck_us]
    assert rolled_m(since) <= limits.v_m_per_s * stands_s
    side = "ahead of" if jump_s > 0 else "behind"
    said = f"the camera clock is {abs(jump_s):.0f} s {side} this computer's clock"
    assert said in stage.commander.controller.reason
    # It looks on, and ends in words; no step waits for the one before.
    stage.run(settings.pause_limit_s + 1.0)
    assert said in stage.message
    steps = [t for t in tap.stepped_us if struck_us <= t <= stage.ended_us]
    assert len(steps) == pytest.approx((stage.ended_us - struck_us) * 20e-6, abs=2)
    assert max(pieces) <= MEMORY_S / settings.dt_s + 2
    judge_motion(stage)
    stage.close()


@ROBOT
@pytest.mark.parametrize("activity", ["park", "calibrate"])
def test_cameras_a_day_behind_from_the_beginning_are_waited_for_in_words(
    robot, activity, tmp_path, pieces
):
    wrong = [Fault(kind="camera_clock", jump_s=-DAY_S)]
    stage, tap = stage_of(robot, tmp_path, activity, wrong)
    stage.run(10.0)
    assert rolled_m(stage.witness.sights) == 0.0
    assert "the camera clock is 86400 s behind this computer's clock" in stage.told
    if activity == "park":
        assert len(tap.stepped_us) == pytest.approx(200, abs=2)
    assert sum(pieces) == 0
    stage.close()


def test_a_robot_that_waits_for_hours_thinks_no_longer_than_one_that_waits_for_seconds(
    tmp_path, pieces
):
    """A first frame, then none for long: the walk from it until now stays within 5 s."""
    stage, _ = stage_of("kinematic", tmp_path)
    stage.run(0.2)
    Inject(Fault(kind="occlusion"))(stage)
    stage.run(30.0)
    assert "waits" in stage.session
    assert max(pieces) <= MEMORY_S / stage.config.controller.dt_s + 102
    stage.close()
