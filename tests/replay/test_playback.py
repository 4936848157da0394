"""What is due when, whatever a person does: against the definition, event by event."""

from itertools import accumulate

from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.replay.playback import FASTEST, SHORTEST_LOOP_US, SLOWEST, Playback

STEPS = st.lists(st.integers(0, 200_000), min_size=1, max_size=40)
CLOCK = st.lists(st.integers(0, 300_000), min_size=1, max_size=60)
SPEEDS = st.sampled_from([0.25, 0.5, 1.0, 2.0, 10.0])


def due_of(steps):
    """Return ascending times that begin with 0."""
    return [0, *accumulate(steps)]


@st.composite
def stretches(draw):
    due = due_of(draw(STEPS))
    start = draw(st.integers(0, due[-1]))
    return due, start, draw(st.integers(start, due[-1] + 10))


@given(stretches(), CLOCK, SPEEDS, st.integers(-(10**9), 10**12))
def test_each_event_of_the_stretch_is_due_once_in_order_and_never_early(
    stretch, clock, speed, began
):
    due, start, end = stretch
    playback = Playback(due, began, speed=speed, start_us=start, end_us=end)
    now, taken = began, []
    for step in [*clock, 10**9]:
        now += step
        for event in playback.take(now):
            assert due[event] <= start + (now - began) * speed
            assert playback.lateness_us(event, now) >= 0
            taken.append(event)
        wait = playback.wait_us(now)
        assert (wait is None) == playback.finished
        if wait:
            # Nothing is due before, and then something is; a rounded us aside.
            assert not playback.take(now + wait - 2)
    assert taken == [k for k, at in enumerate(due) if start <= at <= end]
    assert playback.finished


@given(stretches(), SPEEDS)
def test_a_loop_goes_on_where_the_pass_before_ended(stretch, speed):
    due, start, end = stretch
    inside = [k for k, at in enumerate(due) if start <= at <= end]
    playback = Playback(due, 0, speed=speed, start_us=start, end_us=end, loop=True)
    period = max((end - start) / speed, SHORTEST_LOOP_US)
    now, passes, taken = 0, 3, []
    while now < (passes - 0.5) * period:
        taken += playback.take(now)
        assert not playback.finished
        now += max(1, round(period / 50))
    assert taken[: len(inside)] == inside
    # However coarse the clock, no pass drifts against the one before.
    assert len(inside) * 2 <= len(taken) <= len(inside) * passes
    assert all(one == inside[k % len(inside)] for k, one in enumerate(taken) if inside)


ACTIONS = st.one_of(
    st.tuples(st.just("seek"), st.integers(-(10**6), 10**7)),
    st.tuples(st.just("speed"), st.floats(1e-6, 1e6)),
    st.tuples(st.just("playing"), st.booleans()),
    st.tuples(st.just("toggle"), st.none()),
    st.tuples(st.just("time"), st.integers(0, 10**6)),
)


@given(stretches(), st.lists(ACTIONS, max_size=30), st.booleans(), st.booleans())
def test_whatever_is_pressed_it_stays_in_its_stretch_and_goes_on_in_order(
    stretch, actions, loop, paused
):
    due, start, end = stretch
    playback = Playback(due, 0, start_us=start, end_us=end, loop=loop, paused=paused)
    now, last = 0, None
    for action, value in actions:
        before = playback.position_us(now)
        if action == "seek":
            playback.seek(value, now)
            assert playback.position_us(now) == min(max(value, start), end)
            last = None
        elif action == "speed":
            playback.set_speed(value, now)
            assert SLOWEST <= playback.speed <= FASTEST
            assert playback.position_us(now) == before
        elif action == "playing":
            playback.set_playing(value, now)
            assert playback.position_us(now) == before
        elif action == "toggle":
            playback.toggle(now)
        else:
            now += value
            assert playback.playing or playback.position_us(now) == before
        assert start <= playback.position_us(now) <= end
        for event in playback.take(now):
            assert playback.playing
            assert start <= due[event] <= end
            assert last is None or event == last + 1 or (loop and event < last + 1)
            last = event
        assert playback.playing or playback.wait_us(now) is None


def test_who_goes_back_hears_again_what_was_said_from_there_on():
    playback = Playback([0, 100, 200, 300], 0)
    assert list(playback.take(250)) == [0, 1, 2]
    playback.seek(100, 250)
    assert playback.next_event == 1
    assert playback.wait_us(250) == 0
    assert list(playback.take(350)) == [1, 2]
    playback.set_speed(2.0, 350)
    assert playback.wait_us(350) == 50
    playback.set_playing(False, 375)
    assert list(playback.take(10**9)) == []
    playback.toggle(10**9)
    assert list(playback.take(10**9 + 25)) == [3]
    assert playback.finished


def test_an_empty_log_is_over_at_once():
    playback = Playback([], 0)
    assert playback.finished
    assert not playback.take(10)
