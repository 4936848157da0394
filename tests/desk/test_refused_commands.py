"""Whether a commander notices that its commands are refused, and never without a reason."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lcmtypes
from offboard.desk.refused_commands import CLOCKS_TAKE, RefusedCommands

OURS, LIMIT_S = 2, 2.0
STATUS = lcmtypes.onboard_status_t
STATUS_S = 0.1
COMMANDS = 2
"""From one status to the next."""
KINDS = {
    "refused_order": "under this one's number",
    "refused_value": "tighter limits",
    "refused_type": "another kind of robot",
    "refused_stale": "clocks of desk and board",
}


class Board:
    """Says of each status what it took."""

    def __init__(self, **start):
        self.judge, self.status = RefusedCommands(OURS, LIMIT_S), STATUS()
        self.status.state, self.status.commander = STATUS.DRIVING, OURS
        for field, value in start.items():
            setattr(self.status, field, value)
        self.sent, self.now_us = 0, 50_000_000

    def step(self, *, sent=COMMANDS, **counted):
        self.sent += sent
        for field, number in counted.items():
            setattr(self.status, field, getattr(self.status, field) + number)
        self.now_us += round(STATUS_S * 1e6)
        self.judge.see(self.status, self.sent, self.now_us)
        return self.judge.complaint

    def said_after_s(self, limit_s=60.0, **counted):
        for k in range(round(limit_s / STATUS_S)):
            if self.step(**counted):
                return (k + 1) * STATUS_S
        return None


@pytest.mark.parametrize("kind", KINDS)
def test_commands_that_are_refused_are_named_within_the_limit(kind):
    board = Board(accepted=1000, refused_order=77)
    assert board.said_after_s(accepted=COMMANDS) is None
    said_s = board.said_after_s(**{kind: COMMANDS})
    limit_s = LIMIT_S * (CLOCKS_TAKE if kind == "refused_stale" else 1.0)
    assert said_s <= limit_s + STATUS_S
    assert KINDS[kind] in board.judge.complaint


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [1, 10, 1000])
def test_what_strangers_send_beside_commands_that_are_taken_is_noise(kind, noise):
    """Unless it is under our number, where theirs are taken, or ours, for what is newer."""
    said_s = Board().said_after_s(**{"accepted": COMMANDS, kind: noise * COMMANDS})
    assert (said_s is not None) is (kind == "refused_order")


def test_commands_of_another_under_our_number_are_named_also_where_ours_are_taken():
    board = Board()
    assert board.said_after_s(limit_s=10.0, accepted=COMMANDS) is None
    assert board.said_after_s(accepted=2 * COMMANDS) <= LIMIT_S + STATUS_S
    assert "of which this program sent" in board.judge.complaint


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.9), st.integers(0, 3))
def test_loss_delay_and_doubled_messages_are_no_strangers(seed, loss, burst):
    """Each command is taken at most once, lost or late; of two copies one is refused."""
    rng, board = np.random.default_rng(seed), Board()
    late = 0
    for _ in range(300):
        arrive = late + rng.binomial(COMMANDS, 1.0 - loss)
        late = int(rng.integers(0, burst + 1)) if arrive > burst else 0
        doubled = rng.binomial(arrive, 0.1)
        assert not board.step(accepted=arrive - late, refused_order=min(doubled, 1))


@pytest.mark.parametrize(
    "field_values",
    [{"commander": 17}, {"state": STATUS.ESTOP}, {"state": STATUS.FAULT}],
    ids=str,
)
def test_nothing_is_said_of_a_robot_that_another_holds_or_that_is_stopped(field_values):
    board = Board(**field_values)
    assert board.said_after_s(refused_order=COMMANDS, accepted=COMMANDS) is None


def test_a_radio_that_keeps_a_second_of_commands_and_hands_them_over_late_is_no_stranger():
    """The watchdog has stopped the robot meanwhile, so that it refuses all of them."""
    board = Board()
    for _ in range(5):
        assert board.said_after_s(limit_s=4.0, accepted=COMMANDS) is None
        kept = round(1.0 / STATUS_S) * COMMANDS
        board.now_us += 1_000_000
        assert board.step(sent=kept, refused_order=0) is None
        assert board.step(refused_order=kept) is None
        for _ in range(3):
            assert board.step(refused_order=COMMANDS) is None


def test_an_onboard_program_that_starts_again_counts_anew():
    board = Board(accepted=5000, refused_order=300)
    for _ in range(10):
        for _ in range(15):
            board.step(refused_order=COMMANDS)
        board.status.accepted = board.status.refused_order = 0
        assert board.step() is None
        board.status.accepted = 5000
