"""The queue of what a page has started, by plain calls."""

import pytest

from koopman_lab.errors import LabStateError
from offboard.monitor.state_in_words import BAD, GOOD, IDLE, StateInWords
from offboard.viewer.job_queue import MOST_KEPT, MOST_WAITING, JobQueue, Stage

WELL, BADLY = StateInWords("parked", GOOD), StateInWords("failed", BAD)


def add(queue, now_s=0.0):
    return queue.add("park", ["park"], {"Model": "a"}, drives=True, now_s=now_s).number


def states(queue):
    return [(job.number, job.stage.value, job.state.word) for job in queue.jobs()]


def test_one_runs_and_the_others_follow_in_order():
    queue = JobQueue()
    first, second = add(queue), add(queue)
    assert queue.next().number == first
    queue.begin(first, "runs/a", 1.0)
    assert queue.next() is None
    queue.end(first, WELL, 2.0)
    assert queue.next().number == second
    assert states(queue) == [(second, "waiting", "waiting"), (first, "ended", "parked")]


def test_nothing_begins_behind_what_went_wrong():
    queue = JobQueue()
    first, second, third = (add(queue) for _ in range(3))
    queue.begin(first, "", 1.0)
    queue.end(first, BADLY, 2.0)
    assert queue.next() is None
    for number in (second, third):
        job = next(job for job in queue.jobs() if job.number == number)
        assert job.state == ("not started", IDLE, "the run before it ended: failed")


def test_a_stop_takes_away_what_waits_and_leaves_what_runs():
    queue = JobQueue()
    first, second = add(queue), add(queue)
    queue.begin(first, "", 1.0)
    queue.withdraw("STOP was pressed", 2.0)
    assert queue.running.number == first
    assert states(queue) == [(first, "running", "running"), (second, "ended", "not started")]


def test_what_runs_is_ended_by_somebody_else_and_what_has_ended_stays():
    queue = JobQueue()
    number = add(queue)
    queue.begin(number, "", 1.0)
    assert queue.remove(number, 2.0).stage is Stage.running
    assert queue.running.number == number
    queue.stop(number)
    assert queue.running.stopping
    queue.end(number, BADLY, 3.0)
    for gone in (number, 99):
        with pytest.raises(LabStateError, match="ended already"):
            queue.remove(gone, 4.0)


def test_what_waits_and_what_is_kept_is_bounded():
    queue = JobQueue()
    for k in range(5 * MOST_KEPT):
        queue.begin(add(queue), "", float(k))
        queue.end(queue.running.number, WELL, float(k))
    assert len(queue.jobs()) == MOST_KEPT
    assert queue.jobs()[0].ended_s == 5 * MOST_KEPT - 1
    for _ in range(MOST_WAITING):
        add(queue)
    with pytest.raises(LabStateError, match="wait already"):
        add(queue)


def test_every_change_is_counted_and_nothing_else_is():
    queue = JobQueue()
    seen = [queue.version]
    number = add(queue)
    seen.append(queue.version)
    queue.begin(number, "", 1.0)
    seen.append(queue.version)
    queue.note(number, "parking: 3 of 30 s")
    seen.append(queue.version)
    assert seen == sorted(set(seen))
    queue.note(number, "parking: 3 of 30 s")
    queue.jobs()
    queue.next()
    assert queue.version == seen[-1]
