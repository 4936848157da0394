"""Who is alive, by plain calls: heartbeats and what commands say in, entries out."""

import pytest

import lcmtypes
from offboard.monitor.process_states import MOST_OF_A_NAME, SILENT_S, ProcessStates

TOLD = lcmtypes.process_t
SECOND_US = 1_000_000


def beat(pid):
    message = lcmtypes.node_status_t()
    message.pid = pid
    return message.encode()


def report(name, pid, state, supervisor=1):
    message = TOLD()
    message.name, message.pid, message.state, message.supervisor_pid = name, pid, state, supervisor
    return message


def states(processes, now_us):
    return [(e.name, e.pid, e.state) for e in processes.entries(now_us)]


@pytest.mark.parametrize(
    ("name", "state", "shown"),
    [
        ("plant", TOLD.STARTING, "starting"),
        ("plant", TOLD.RUNNING, "alive"),
        ("plant", TOLD.SILENT, "silent"),
        ("view", TOLD.RUNNING, "alive"),
    ],
)
def test_a_page_opened_later_knows_from_the_supervisor_how_a_process_is(name, state, shown):
    processes = ProcessStates()
    processes.take_report(report(name, 7, state), 0)
    assert states(processes, SECOND_US) == [(name, 7, shown)]
    assert states(processes, round(SILENT_S * 1e6) + 1) == [(name, 7, "silent")]


def test_a_hung_process_is_silent_however_long_its_supervisor_says_that_it_runs():
    processes = ProcessStates()
    processes.take_heartbeat("plant", beat(7), 0)
    processes.take_report(report("plant", 7, TOLD.RUNNING), 6 * SECOND_US)
    (entry,) = processes.entries(6 * SECOND_US)
    assert (entry.state, entry.age_s) == ("silent", 6.0)


def test_the_loggers_of_two_commands_are_two_rows():
    processes = ProcessStates()
    for now_us in range(0, 3 * SECOND_US, SECOND_US):
        for pid, supervisor in ((7, 70), (9, 90)):
            processes.take_heartbeat("logger", beat(pid), now_us)
            processes.take_report(report("logger", pid, TOLD.RUNNING, supervisor), now_us)
    entries = processes.entries(2 * SECOND_US)
    assert [(e.pid, e.state) for e in entries] == [(7, "alive"), (9, "alive")]
    assert [str(s) in e.stopped_by for e, s in zip(entries, (70, 90), strict=True)] == [True, True]
    # One dies; the other goes on, and hides nothing.
    processes.take_report(report("logger", 9, TOLD.DIED, 90), 3 * SECOND_US)
    processes.take_heartbeat("logger", beat(7), 9 * SECOND_US)
    assert states(processes, 9 * SECOND_US) == [("logger", 7, "alive"), ("logger", 9, "died")]
    # The next one takes the place of the one that died.
    processes.take_heartbeat("logger", beat(11), 10 * SECOND_US)
    assert states(processes, 10 * SECOND_US) == [("logger", 7, "alive"), ("logger", 11, "alive")]


def test_a_logger_that_finished_is_not_missed_beside_one_that_goes_on():
    processes = ProcessStates()
    processes.take_heartbeat("logger", beat(7), 0)
    processes.take_report(report("logger", 9, TOLD.FINISHED), SECOND_US)
    assert ("logger", 9, "finished") in states(processes, SECOND_US)
    processes.take_heartbeat("logger", beat(7), 2 * SECOND_US)
    assert states(processes, 2 * SECOND_US) == [("logger", 7, "alive")]


def test_endless_process_ids_fill_no_memory():
    processes = ProcessStates()
    for pid in range(100 * MOST_OF_A_NAME):
        processes.take_report(report("plant", pid, TOLD.DIED), pid)
        processes.take_heartbeat("onboard", beat(pid), 0)
    assert len(processes.entries(SECOND_US)) <= 2 * MOST_OF_A_NAME
