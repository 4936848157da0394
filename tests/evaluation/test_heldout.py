"""Errors on runs that were held out, against what is known in closed form."""

import dataclasses

import numpy as np
import pytest
from ideal_data import ideal_dataset

from koopman_lab.evaluation.heldout import errors, held_out_runs, split
from koopman_lab.koopman.trainer import train


@pytest.fixture(scope="module")
def kinematic():
    return ideal_dataset("kinematic", segments=10)


@pytest.fixture(scope="module")
def exact(kinematic):
    return train(kinematic, "D5t")[0]


@pytest.mark.parametrize("steps", [1, 2, 20, 40])
def test_an_exact_model_has_no_error_however_far_it_looks(kinematic, exact, steps):
    found = errors(exact, kinematic, steps)
    assert found.steps == steps
    assert found.starts == 2 * 10 * (41 - steps)
    assert found.position_max_m < 1e-10
    assert found.angle_max_rad < 1e-10
    assert found.v_mean_m_per_s is None


def test_an_offset_of_the_truth_is_the_error(kinematic, exact):
    offset = np.array([0.003, 0.004, -0.02])
    moved = dataclasses.replace(kinematic, Y={i: y + offset for i, y in kinematic.Y.items()})
    for steps in (1, 10):
        found = errors(exact, moved, steps)
        assert found.position_mean_m == pytest.approx(0.005, abs=1e-10)
        assert found.position_max_m == pytest.approx(0.005, abs=1e-10)
        assert found.angle_mean_rad == pytest.approx(0.02, abs=1e-10)


def test_errors_of_velocities_are_told_for_the_second_order_robot():
    dataset = ideal_dataset("dynamic", segments=10)
    model, _ = train(dataset, "D8Eul")
    offset = np.array([0.0, 0.0, 0.0, 0.1, -0.2])
    faster = dataclasses.replace(dataset, Y={i: y + offset for i, y in dataset.Y.items()})
    found = errors(model, faster, 5)
    assert found.v_mean_m_per_s == pytest.approx(0.1, abs=1e-9)
    assert found.omega_mean_rad_per_s == pytest.approx(0.2, abs=1e-9)


def test_a_prediction_never_leaves_its_run(kinematic, exact):
    """Runs of 40 pairs that follow each other in time without a pause."""
    together = dataclasses.replace(
        kinematic, start_us={i: np.arange(len(x)) * 50_000 for i, x in kinematic.X.items()}
    )
    assert errors(exact, together, 40).starts == 2 * 10
    assert errors(exact, together, 41) is None


def test_the_order_of_the_pairs_does_not_matter(kinematic, exact):
    rng = np.random.default_rng(4)
    orders = {i: rng.permutation(len(x)) for i, x in kinematic.X.items()}
    shuffled = dataclasses.replace(
        kinematic,
        **{
            name: {i: getattr(kinematic, name)[i][order] for i, order in orders.items()}
            for name in ("X", "Y", "segments", "start_us")
        },
    )
    assert errors(exact, shuffled, 7).starts == errors(exact, kinematic, 7).starts
    assert errors(exact, shuffled, 7).position_max_m < 1e-10


def test_pairs_of_unknown_time_have_errors_of_one_step_only(kinematic, exact):
    unknown = dataclasses.replace(
        kinematic,
        segments={i: np.zeros_like(s) for i, s in kinematic.segments.items()},
        start_us={i: np.zeros_like(s) for i, s in kinematic.start_us.items()},
    )
    assert errors(exact, unknown, 1).position_max_m < 1e-10
    assert errors(exact, unknown, 2) is None


def test_every_fifth_run_is_held_out_and_nothing_is_lost(kinematic):
    runs = held_out_runs(kinematic)
    assert {i: numbers.tolist() for i, numbers in runs.items()} == {1: [4, 9], 2: [4, 9]}
    rest, held = split(kinematic, runs)
    for index, x in kinematic.X.items():
        assert len(rest.X[index]) + len(held.X[index]) == len(x)
        assert set(held.segments[index].tolist()) == {4, 9}
        assert not set(rest.segments[index].tolist()) & {4, 9}
