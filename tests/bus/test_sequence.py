"""What a stream lost, by its numbers: against what was sent and did not arrive."""

from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.bus.sequence import SequenceCounter


@given(st.lists(st.booleans(), min_size=1))
def test_gaps_are_counted_exactly_up_to_the_last_message_received(received):
    counter = SequenceCounter()
    for sequence, arrived in enumerate(received):
        if arrived:
            counter.update(sequence, sequence)
    numbers = [i for i, arrived in enumerate(received) if arrived]
    lost = numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 0
    assert counter.lost == lost


def test_a_publisher_that_starts_again_is_no_loss():
    counter = SequenceCounter()
    assert [counter.update(n, 10 * k) for k, n in enumerate((7, 8, 0, 1, 4))] == [0, 0, 0, 0, 2]


@given(
    st.lists(st.tuples(st.sampled_from(["older", "younger"]), st.booleans()), max_size=200),
    st.integers(300, 1000),
    st.booleans(),
)
def test_two_that_speak_at_once_miss_only_what_is_lost(story, ahead, older_is_first):
    counter, said = SequenceCounter(), {"older": ahead, "younger": 2}
    for sequence in (ahead - 1, 0, 1) if older_is_first else (0, ahead - 1, 1):
        counter.update(sequence, sequence)
    lost, unnoticed = 0, {"older": 0, "younger": 0}
    for who, arrives in story:
        if arrives:
            counter.update(said[who], said[who])
            lost, unnoticed[who] = lost + unnoticed[who], 0
        else:
            unnoticed[who] += 1
        said[who] += 1
    assert (counter.lost, counter.restarts) == (lost, 1)


@given(st.permutations(range(10)), st.integers(1, 1000))
def test_what_was_overtaken_or_came_twice_is_no_loss(order, start):
    counter = SequenceCounter()
    for sequence in (start - 1, start - 1, *(start + n for n in order), start + 10, start + 10):
        counter.update(sequence, sequence)
    assert counter.lost == 0
