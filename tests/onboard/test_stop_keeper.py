"""A stop outlasts the program that holds it: death and start at any moment, disks that fail."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motor_bench import Bench, MemoryStore

from koopman_lab.bus.motor_loop_faults import Fault
from koopman_lab.config.load import load_config
from onboard.motor_loop.loop import MotorLoop, State
from onboard.motor_loop.stop_keeper import TRY_AGAIN_US, StopKeeper, StopRecord
from onboard.motor_loop.stop_latch import NO_STOP

CONFIG = load_config()
STOPPED = (State.ESTOP, State.FAULT)


class Board(Bench):
    """A board whose program can die and start again; its clock may be set meanwhile."""

    def __init__(self, store=None):
        super().__init__(CONFIG)
        self.store = store or MemoryStore()
        self.now_us = 60_000_000
        self.confirmed = False
        """Whether the last status said that a stop holds the robot, which nobody released."""
        self.start()

    def start(self):
        self.loop = MotorLoop(CONFIG)
        self.keeper = StopKeeper(self.loop, self.store)
        self.keeper.begin(self.now_us)
        assert not self.confirmed or self.loop.state in STOPPED

    def tick(self):
        super().tick()
        self.keeper.keep(self.now_us)

    def status(self):
        """Say what ONBOARD_STATUS does."""
        self.keeper.keep(self.now_us)
        healing = self.loop.state is State.FAULT and self.loop.fault is Fault.ENCODERS_SILENT
        self.confirmed = self.loop.state in STOPPED and not healing

    # Events.

    def stop(self):
        self.loop.stop(self.now_us, self.now_us)

    def release(self):
        self.confirmed = False
        super().release()

    def die(self):
        self.start()

    def clock_set_back(self):
        self.now_us = 1_000_000

    def begin(self):
        self.command((0.3, 0.0))

    def empty_battery(self):
        self.battery_v = 6.0
        for _ in range(55):
            self.tick()
        self.battery_v = 7.4

    def encoders_silent(self):
        self.silent = True
        for _ in range(40):
            self.begin()
            self.tick()
        self.silent = False


EVENTS = ("stop", "release", "die", "clock_set_back", "begin", "empty_battery", "encoders_silent")


@given(st.lists(st.sampled_from((*EVENTS, "tick", "status")), max_size=30))
def test_whatever_happens_a_confirmed_stop_holds_over_a_death_until_it_is_released(events):
    """And under a higher number than any that a status has told."""
    board = Board()
    numbers = []
    for event in events:
        getattr(board, event)()
        if event == "status" and board.confirmed:
            number = board.loop.stop_latch.number
            assert number in numbers[-1:] or all(number > known for known in numbers)
            numbers.append(number)


def test_a_robot_that_was_never_stopped_starts_and_drives_and_leaves_no_record():
    board = Board()
    assert board.loop.state is State.REST
    assert board.loop.stop_latch.number == NO_STOP
    board.begin()
    board.tick()
    assert board.loop.state is State.DRIVING
    assert board.store.record is None


@pytest.mark.parametrize(
    ("event", "state", "fault"),
    [
        ("stop", State.ESTOP, Fault.NO_FAULT),
        ("empty_battery", State.FAULT, Fault.BATTERY_LOW),
    ],
)
def test_a_stop_or_fault_is_the_same_after_a_start_under_a_number_that_nobody_knows(
    event, state, fault
):
    board = Board()
    getattr(board, event)()
    board.tick()
    old = board.loop.stop_latch.number
    board.clock_set_back()
    board.start()
    assert (board.loop.state, board.loop.fault) == (state, fault)
    assert board.loop.stop_latch.number > old
    # A release of before, by number or by its stamp, does not count; one of now does.
    board.loop.release(old, board.now_us)
    board.loop.release(NO_STOP, board.now_us - 1)
    board.begin()
    board.tick()
    assert board.loop.state is state
    board.release()
    board.tick()
    board.start()
    assert board.loop.state is State.REST
    board.stop()
    assert board.loop.stop_latch.number > old, "numbers go on also where none holds"


def test_it_is_written_down_before_a_status_says_so_and_once():
    board = Board()
    board.stop()
    assert board.store.record is None, "the motors come first"
    board.keeper.keep(board.now_us)
    assert board.store.record == StopRecord(board.loop.stop_latch.number, holds=True)
    for _ in range(300):
        board.tick()
    assert board.store.writes == 1
    board.release()
    board.keeper.keep(board.now_us)
    assert not board.store.record.holds


def test_encoders_that_are_heard_again_are_no_stop_that_waits_for_anybody():
    board = Board()
    board.encoders_silent()
    assert board.loop.fault is Fault.ENCODERS_SILENT
    assert board.store.record is None
    board.start()
    assert board.loop.state is State.REST


def test_where_the_record_cannot_be_read_a_start_is_a_stopped_start():
    store = MemoryStore()
    store.readable = False
    board = Board(store)
    assert (board.loop.state, board.loop.fault) == (State.FAULT, Fault.STOP_NOT_KEPT)
    assert board.keeper.trouble == "cannot be read"
    board.release()
    board.begin()
    board.tick()
    assert board.loop.state is State.DRIVING


def test_a_stop_that_cannot_be_written_down_is_a_fault_and_tried_again():
    board = Board()
    board.store.writable = False
    board.stop()
    board.tick()
    assert (board.loop.state, board.loop.fault) == (State.FAULT, Fault.STOP_NOT_KEPT)
    # Pressed again, it is no emergency stop that a status confirms.
    board.stop()
    board.status()
    assert board.loop.state is State.FAULT
    board.store.writable = True
    board.now_us += TRY_AGAIN_US + 1
    board.tick()
    assert board.store.record.holds
    assert not board.keeper.trouble


def test_a_release_that_cannot_be_written_down_lets_go_and_a_start_is_stopped():
    board = Board()
    board.stop()
    board.tick()
    board.store.writable = False
    board.release()
    board.tick()
    assert board.loop.state is State.REST
    board.start()
    assert board.loop.state in STOPPED
