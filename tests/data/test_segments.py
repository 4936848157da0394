import numpy as np
import pytest

import lcmtypes
from koopman_lab.bus.message_values import padded
from koopman_lab.data.message_arrays import decode_all, native_dtype
from koopman_lab.data.segments import basis_runs, completed, cut
from koopman_lab.eventlog.message_blocks import Messages

BASIS, BRAKE, LAUNCH = (
    lcmtypes.sampler_state_t.BASIS,
    lcmtypes.sampler_state_t.BRAKE,
    lcmtypes.sampler_state_t.LAUNCH,
)
MS = 1000


def sampler(*rows):
    """Return states 50 ms apart from (phase, segment, basis index)."""
    made = []
    for count, (phase, segment, index) in enumerate(rows):
        state = lcmtypes.sampler_state_t()
        state.utime, state.sequence, state.phase = 50 * MS * count, count, phase
        state.segment, state.basis_index = segment, index
        state.inputs, state.u = 2, padded((0.1 * index, 0.5), state.MOST_INPUTS)
        made.append(state.encode())
    return decode_all(lcmtypes.sampler_state_t, Messages.joined(made))[0]


def camera(count, step_us=4 * MS):
    frames = np.zeros(count, native_dtype(lcmtypes.mocap_pose_t))
    frames["utime"] = np.arange(count) * step_us
    frames["sequence"] = np.arange(count) + 700
    frames["x1_m"] = np.arange(count)
    frames["tracking_valid"] = True
    return frames


THREE_RUNS = sampler(
    (LAUNCH, 0, 1),
    (BASIS, 0, 1),
    (BASIS, 0, 1),
    (BRAKE, 0, 2),
    (BASIS, 1, 2),
    (BASIS, 2, 2),
    (BASIS, 2, 2),
    (BRAKE, 0, 0),
)


def spans(runs):
    return [(r.number, r.basis_index, r.start_us // MS, r.end_us // MS) for r in runs]


def test_a_run_lasts_from_its_first_state_to_the_first_state_after_it():
    runs = basis_runs(THREE_RUNS)
    assert spans(runs) == [(0, 1, 50, 150), (1, 2, 200, 250), (2, 2, 250, 350)]
    assert runs[0].u == (0.1, 0.5)


def test_the_order_of_arrival_and_repeated_states_change_nothing():
    shuffled = THREE_RUNS[[3, 0, 5, 5, 1, 7, 6, 2, 4, 4]]
    assert spans(basis_runs(shuffled)) == spans(basis_runs(THREE_RUNS))


def test_a_run_whose_end_was_not_seen_ends_with_its_last_state():
    assert spans(basis_runs(THREE_RUNS[:3])) == [(0, 1, 50, 100)]
    without_brake = np.delete(THREE_RUNS, 3)
    assert spans(basis_runs(without_brake))[0] == (0, 1, 50, 100)


def test_a_run_whose_start_was_not_seen_begins_with_its_first_known_state():
    assert spans(basis_runs(np.delete(THREE_RUNS, 1)))[0] == (0, 1, 100, 150)


def test_states_without_a_run_give_none():
    assert basis_runs(THREE_RUNS[:0]) == []
    assert basis_runs(THREE_RUNS[[0, 3]]) == []


def cut_200_to_250(frames, **discard):
    """Cut the run from 200 to 250 ms."""
    return cut(basis_runs(THREE_RUNS)[1:2], frames, frame_rate_hz=250.0, **discard)


def numbers(segments):
    return [segment.poses[:, 0].astype(int).tolist() for segment in segments]


def test_a_segment_holds_the_frames_from_first_to_last_command_both_ends_included():
    (segment,) = cut_200_to_250(camera(100))
    assert segment.utime_us.tolist() == [t * MS for t in range(200, 251, 4)]
    assert numbers([segment]) == [list(range(50, 63))]
    assert segment.run.number == 1


def test_both_ends_are_discarded_on_request():
    assert numbers(cut_200_to_250(camera(100), discard_start_s=0.02, discard_end_s=0.01)) == [
        list(range(55, 61))
    ]
    assert cut_200_to_250(camera(100), discard_start_s=0.06) == []
    assert cut_200_to_250(camera(100), discard_start_s=0.03, discard_end_s=0.03) == []


def lost(frames, number):
    return np.delete(frames, number)


def not_tracked(frames, number):
    frames["tracking_valid"][number] = False
    return frames


def not_a_number(frames, number):
    frames["theta_rad"][number] = np.nan
    return frames


def lost_unnumbered(frames, number):
    frames = np.delete(frames, number)
    frames["sequence"] = np.arange(len(frames))
    return frames


@pytest.mark.parametrize("harm", [lost, not_tracked, not_a_number, lost_unnumbered])
def test_nothing_is_bridged(harm):
    assert numbers(cut_200_to_250(harm(camera(100), 55))) == [
        list(range(50, 55)),
        list(range(56, 63)),
    ]
    assert numbers(cut_200_to_250(harm(camera(100), 50))) == [list(range(51, 63))]
    assert numbers(cut_200_to_250(harm(camera(100), 62))) == [list(range(50, 62))]
    assert numbers(cut_200_to_250(harm(camera(100), 49))) == [list(range(50, 63))]


def test_frames_that_arrive_late_or_twice_are_put_in_order():
    frames = camera(100)
    order = np.r_[0:54, 58, 54:60, 60:100]
    assert numbers(cut_200_to_250(frames[order])) == numbers(cut_200_to_250(frames))


def test_a_run_without_frames_gives_no_segment():
    assert cut_200_to_250(camera(0)) == []
    assert cut_200_to_250(camera(20)) == []


def test_only_runs_after_which_one_more_segment_counts_are_complete():
    states, runs = THREE_RUNS.copy(), basis_runs(THREE_RUNS)
    assert completed(runs, states) == []
    # The first is complete, the second was given up, and after the third the log goes on.
    states["segments_done"][3:] += 1
    states["segments_done"][7:] += 1
    assert completed(runs, states) == [runs[0], runs[2]]
    # Nothing shows that the last run was completed, if the log ends in it.
    assert completed(basis_runs(states[:7]), states[:7]) == [runs[0]]
    # A state that was lost is made up for by the next.
    lost = np.delete(states, 3)
    assert [run.number for run in completed(basis_runs(lost), lost)] == [0, 2]
