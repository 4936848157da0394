"""Stamps of another time keep no robot from being driven unseen, and name the clock."""

import pytest
from drive_inputs_bench import Bench
from hostile.times import HOSTILE

import lcmtypes
from koopman_lab.bus import channels
from offboard.desk.interlock import Cause

HOUR_US = 3_600_000_000
CLOCKS = {
    channels.WHEEL_STATE: "the onboard clock",
    channels.ONBOARD_STATUS: "the onboard clock",
    channels.LOGGER_STATUS: "the logger's clock",
}


@pytest.mark.parametrize("channel", CLOCKS, ids=lambda channel: channel.suffix)
@pytest.mark.parametrize(("off_us", "said"), [(HOUR_US, "ahead of"), (-24 * HOUR_US, "behind")])
def test_a_clock_that_is_wrong_is_named_and_the_robot_waits_for_it(channel, off_us, said):
    bench = Bench()
    assert bench.after(2.0) is None
    bench.speakers.off_us[channel.suffix] = off_us
    interlock = bench.after(6.0)
    assert interlock.reason.startswith(f"{CLOCKS[channel]} is ")
    assert f"{abs(off_us) // 1_000_000} s {said} this computer's clock" in interlock.reason
    assert (interlock.cause, interlock.lasting) == (Cause.SILENCE, False)
    bench.speakers.off_us.clear()
    assert bench.after(2.0) is None


@pytest.mark.parametrize("channel", CLOCKS, ids=lambda channel: channel.suffix)
@pytest.mark.parametrize("what", HOSTILE)
def test_one_message_of_another_time_is_passed_over(channel, what):
    bench = Bench()
    assert bench.after(2.0) is None
    off_us = HOSTILE[what](bench.lab.now_us) - bench.lab.now_us
    bench.speakers.off_us[channel.suffix] = max(-(2**62), min(2**62, off_us))
    bench.after(0.05)
    bench.speakers.off_us.clear()
    for _ in range(20):
        assert bench.after(0.05) is None


@pytest.mark.parametrize("what", [what for what in HOSTILE if "just inside" not in what])
def test_one_recorded_frame_of_another_time_does_not_stop_a_session(what):
    bench = Bench()
    assert bench.after(2.0) is None
    frame = lcmtypes.mocap_pose_t()
    now_us = bench.lab.now_us
    frame.utime = max(-(2**63), min(2**63 - 1, HOSTILE[what](now_us)))
    frame.x1_m, frame.tracking_valid = 0.3, True
    bench.speakers.stray.append(frame)
    for _ in range(20):
        assert bench.after(0.05) is None
