"""Messages with the tag of the lab's key in logs: sent again they move nobody; read as any."""

import subprocess

import pytest
from klab import SHORT_RUNS, klab
from real_bus import STATUS, StrangersLab, commands, recorded, tool

from koopman_lab.bus import channels
from koopman_lab.bus.authentication import Verdict, Verifier
from koopman_lab.bus.lab_key import read_key, write_new_key
from koopman_lab.data.decode import SessionLog


@pytest.fixture
def lab_key(tmp_path):
    write_new_key(tmp_path / "lab.key")
    return tmp_path / "lab.key"


@pytest.mark.parametrize("starts_anew", [False, True])
def test_a_log_of_signed_messages_sent_again_moves_nobody(bus_url, lab_key, tmp_path, starts_anew):
    """By lcm-logplayer: to those who heard it first, and to a robot that was started since."""
    lab, log = StrangersLab(bus_url, ("--set", f"bus.key_file={lab_key}")), tmp_path / "session.lcm"
    url = ("--lcm-url", bus_url)
    logger = subprocess.Popen(
        [tool("lcm-logger"), "--quiet", *url, str(log)], stderr=subprocess.DEVNULL
    )
    try:
        lab.start_robot()
        lab.say((lab.holder, channels.VELOCITY_CMD, commands(lab, 0.3)))
        assert lab.moved_m() > 0.02
        logger.terminate()
        assert logger.wait(60) == 0
        if starts_anew:
            lab.close()
            lab.processes.clear()
            lab.status = None
            lab.poses.clear()
            lab.start_robot()
        else:
            lab.wait(
                lambda: lab.status.state != STATUS.DRIVING and not lab.status.v_setpoint_m_per_s
            )
            lab.watch(1.0)
        lab.poses.clear()
        lab.wait(lambda: lab.poses)
        player = subprocess.Popen([tool("lcm-logplayer"), *url, str(log)])
        lab.wait(lambda: player.poll() is not None)
        assert player.returncode == 0
        lab.watch(0.5)
        assert lab.moved_m() == 0.0
    finally:
        logger.kill()
        logger.wait()
        lab.close()


def test_a_whole_session_with_a_key_is_recorded_and_read_as_any(lab_key, tmp_path):
    """Cameras, counters, commands and status carry the tag; what is learned from them does not."""
    out, key = tmp_path / "calibration", ("--set", f"bus.key_file={lab_key}")
    done = klab("calibrate", "--segments", "2", *SHORT_RUNS, *key, "--out", out)
    assert done.returncode == 0, done.stderr
    messages = recorded(out / "session.lcm")
    for channel in channels.all_channels():
        for data in messages.get(channel.name("R1"), ())[:1]:
            tagged = Verifier(read_key(lab_key), channel.name("R1")).judge(data)
            is_protected = channel.protection != "never"
            assert tagged is (Verdict.VALID if is_protected else Verdict.UNSIGNED), channel
    log = SessionLog(out)
    assert log.channels["R1_MOCAP_POSE"].unreadable == 0
    assert log.channels["R1_VELOCITY_CMD"].count > 20
    done = klab("dataset", "make", out, "--out", tmp_path / "pairs.npz")
    assert done.returncode == 0, done.stderr
