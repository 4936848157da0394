"""What a log says of a node's process, and when it cannot be run again."""

import pytest

import lcmtypes
from koopman_lab.bus.channels import ENCODER, HEARTBEATS
from koopman_lab.config.load import load_config
from koopman_lab.errors import LogError
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.replay.message_types import require_readable, unreadable_channels
from koopman_lab.replay.recorded_process import RecordedProcess, recorded_process
from koopman_lab.units import US_PER_S

CONFIG = load_config(overrides=["simulation.clock.offset_s=2.0", "simulation.clock.drift_ppm=50.0"])
START_US = 1_700_000_000 * US_PER_S
PERIOD_US = 500_000


def beats(node="sampler", pid=4711, start_us=START_US, first=0, count=4, late_us=200, ahead_us=0):
    """Return heartbeats as the logger received them."""
    events = []
    for number in range(first, first + count):
        message = lcmtypes.node_status_t()
        message.utime = start_us + number * PERIOD_US + ahead_us
        message.sequence, message.pid = number, pid
        at_us = start_us + number * PERIOD_US + late_us
        events.append(Event(number, at_us, HEARTBEATS[node].name("R1"), message.encode()))
    return events


def test_lockstep_begins_at_zero():
    process = recorded_process("sampler", CONFIG, beats(pid=0, start_us=0, late_us=0))
    assert process == RecordedProcess(0, 0, simulated=False)
    assert process.virtual


def test_a_process_began_when_its_first_heartbeat_was_due():
    process = RecordedProcess(START_US, 4711, simulated=False)
    assert recorded_process("sampler", CONFIG, beats()) == process
    assert recorded_process("sampler", CONFIG, beats(first=3)) == process
    assert not process.virtual


def test_the_clock_of_a_simulated_board_is_not_the_desks():
    events = beats("onboard", first=4, ahead_us=2 * US_PER_S + 100)  # after 2 s with 50 ppm
    both = sorted(events + beats("plant", pid=4712, count=8), key=lambda event: event.timestamp_us)
    process = recorded_process("onboard", CONFIG, both)
    assert process == RecordedProcess(START_US, 4711, simulated=True)


@pytest.mark.parametrize("preset", ["real", "lab"])
def test_without_a_plant_the_board_was_real_whatever_the_commander_believed(preset):
    config = load_config(preset=preset)
    process = recorded_process("onboard", config, beats("onboard", first=4))
    assert process == RecordedProcess(START_US, 4711, simulated=False)


def test_a_log_that_begins_late_begins_with_the_ticks_of_the_process():
    process = recorded_process("sampler", CONFIG, beats(first=2001))
    assert 0 <= START_US + 2001 * PERIOD_US - process.start_us <= US_PER_S
    assert (process.start_us - START_US) % US_PER_S == 0


def moved(events, at_us):
    return [event._replace(timestamp_us=at_us + event.timestamp_us) for event in events]


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (beats("logger"), "R1_SAMPLER_HEARTBEAT: not in the log"),
        (beats() + beats("controller"), "holds a controller as well"),
        (beats() + beats(pid=5, start_us=START_US + 3 * US_PER_S), "started 2 times"),
        (beats() + beats(start_us=START_US + 3 * US_PER_S), "started 2 times"),
        (moved(beats(pid=0, start_us=0), START_US), "recorded from a replay"),
        (beats() + beats(start_us=START_US + 3600 * US_PER_S), "times of arrival jump 1 times"),
        (beats(ahead_us=3600 * US_PER_S), "stamped 3600 s after the log begins, when it was over"),
        (beats(ahead_us=2**62), "after the log begins, when it was over"),
        ([event._replace(data=bytes(40)) for event in beats()], "R1_SAMPLER_HEARTBEAT: .*types"),
    ],
)
def test_what_cannot_be_run_again_is_refused_in_words(events, words):
    events = sorted(events, key=lambda event: event.timestamp_us)
    with pytest.raises(LogError, match=words):
        recorded_process("sampler", CONFIG, events)


def test_types_that_nobody_asked_for_may_be_of_any_version():
    events = [*beats(), Event(9, START_US + 3 * US_PER_S, ENCODER.name("R1"), bytes(40))]
    assert recorded_process("sampler", CONFIG, events) == RecordedProcess(
        START_US, 4711, simulated=False
    )
    assert unreadable_channels(CONFIG, events) == {"R1_ENCODER": 1}
    damaged = [*events, Event(10, START_US, HEARTBEATS["sampler"].name("R1"), b"?")]
    assert unreadable_channels(CONFIG, damaged) == {"R1_ENCODER": 1}
    require_readable(["R1_SAMPLER_HEARTBEAT"], {"R1_ENCODER": 1})
    with pytest.raises(LogError, match="R1_ENCODER: recorded with other message types"):
        require_readable(["R1_ENCODER", "R1_MOCAP_POSE"], {"R1_ENCODER": 1})
