"""What a person reads of requests that were refused."""

from offboard.viewer.refusals import MOST_HELD, Refusals


def test_the_first_is_said_at_once_and_the_others_are_counted_once_a_second():
    lines = []
    refusals = Refusals(lines.append)
    for k in range(3000):
        refusals.note("10.0.0.7", "order", f"goal {k}", k / 2000)
        refusals.work(k / 2000)
    assert lines == [
        "refused 10.0.0.7: goal 0",
        "refused 10.0.0.7: goal 2000 (the newest of 2000)",
    ]
    refusals.note("10.0.0.8", "order", "goal", 1.5)
    refusals.note("10.0.0.7", "frame", "a binary frame", 1.5)
    assert lines[2:] == ["refused 10.0.0.8: goal", "refused 10.0.0.7: a binary frame"]
    refusals.work(2.1)
    assert lines[4:] == ["refused 10.0.0.7: goal 2999 (the newest of 999)"]
    refusals.work(60.0)
    refusals.work(120.0)
    refusals.note("10.0.0.7", "order", "goal", 120.0)
    assert lines[5:] == ["refused 10.0.0.7: goal"]


def test_memory_and_lines_stay_bounded_however_many_clients_there_are():
    lines = []
    refusals = Refusals(lines.append)
    for k in range(10 * MOST_HELD):
        refusals.note(f"client {k}", "page", "no token", 0.0)
    assert len(lines) == MOST_HELD + 1
    refusals.work(2.0)
    assert lines[-1] == f"refused others: no token (the newest of {9 * MOST_HELD - 1})"
