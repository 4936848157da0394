"""Prediction errors against closed forms."""

import numpy as np
import pytest
from ideal_data import ideal_dataset
from nominal_runs import DT_S, RATE_HZ, run

from koopman_lab.data.reference_trajectories import mean_inputs
from koopman_lab.evaluation.metrics import (
    Starts,
    by_model,
    by_nominal,
    deviations,
    errors_over_time,
    per_step,
    rolling_deviations,
    summary,
)
from koopman_lab.evaluation.trajectory_starts import starts_along
from koopman_lab.koopman.trainer import train
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.robots.kinematic import KINEMATIC
from koopman_lab.robots.table import robot_type


@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_the_nominal_model_has_no_error_on_its_own_trajectories(kind):
    """Frames at the instants of commands alone: elsewhere a step spans two inputs."""
    whole = run(kind)
    at_commands = whole._replace(utime_us=whole.utime_us[::12], x=whole.x[::12])
    starts = starts_along([at_commands], 10, DT_S, 1.0 / DT_S)
    assert len(starts.x0) == 39
    assert starts.inputs[7] == pytest.approx(at_commands.inputs[7:17], abs=1e-12)
    for errors in per_step(
        rolling_deviations(by_nominal(robot_type(kind), DT_S), starts, robot_type(kind))
    ):
        assert errors.starts == 40 - errors.steps
        assert errors.position_max_m < 1e-12
        assert errors.angle_max_rad < 1e-12


def test_from_every_frame_velocities_are_met_exactly_and_poses_nearly():
    starts = starts_along([run(offset_us=1234)], 20, DT_S, RATE_HZ)
    assert len(starts.x0) == 12 * 39
    errors = summary(rolling_deviations(by_nominal(DYNAMIC, DT_S), starts, DYNAMIC)[:, 19], 20)
    assert errors.v_max_m_per_s < 1e-12
    assert errors.omega_max_rad_per_s < 1e-12
    # The angle is off by at most u dt^2 / 8 at either end of the way, whatever is in between.
    assert 0.0 < errors.angle_max_rad < 2 * 0.8 * DT_S**2 / 4


def test_a_bias_of_the_speed_grows_with_the_steps_as_it_must():
    straight = Starts(
        x0=np.zeros((50, 5)),
        inputs=np.zeros((50, 20, 2)),
        truth=np.zeros((50, 20, 5)),
        run=np.zeros(50, np.int64),
        time_s=np.arange(50) / RATE_HZ,
    )
    biased = by_nominal(DYNAMIC, DT_S)
    v, omega = 0.03, -0.2

    def predict(x0, inputs):
        return biased(x0 + np.array([0, 0, 0, v, 0]), inputs)

    def turning(x0, inputs):
        return biased(x0 + np.array([0, 0, 0, 0, omega]), inputs)

    for errors in per_step(rolling_deviations(predict, straight, DYNAMIC)):
        for found in (errors.position_mean_m, errors.position_p95_m, errors.position_max_m):
            assert found == pytest.approx(v * DT_S * errors.steps)
        assert errors.v_max_m_per_s == pytest.approx(v)
        assert errors.angle_max_rad == 0.0
    for errors in per_step(rolling_deviations(turning, straight, DYNAMIC)):
        assert errors.angle_p50_rad == pytest.approx(abs(omega) * DT_S * errors.steps)
        assert errors.omega_mean_rad_per_s == pytest.approx(abs(omega))
        assert errors.position_max_m == 0.0


def test_mean_median_percentile_and_maximum_are_those_of_the_distances():
    off = np.zeros((101, 3))
    off[:, 0], off[:, 1], off[:, 2] = 0.03 * np.arange(101), 0.04 * np.arange(101), 2 * np.pi + 0.1
    errors = summary(deviations(off, np.zeros(3), KINEMATIC), 1)
    assert errors.starts == 101
    assert errors.position_mean_m == errors.position_p50_m == pytest.approx(2.5)
    assert errors.position_p95_m == pytest.approx(4.75)
    assert errors.position_max_m == pytest.approx(5.0)
    assert errors.angle_max_rad == pytest.approx(0.1)
    assert errors.v_max_m_per_s is None


def test_states_that_nobody_measured_count_nowhere():
    whole = run(steps=20)
    kept = np.ones(len(whole.x), bool)
    kept[100:142] = False
    broken = whole._replace(utime_us=whole.utime_us[kept], x=whole.x[kept])
    starts = starts_along([broken], 3, DT_S, RATE_HZ)
    found = rolling_deviations(by_nominal(DYNAMIC, DT_S), starts, DYNAMIC)
    assert np.isfinite(found[:, 0]).all()
    # Neither a start nor, 12 frames later, its first successor lies in the hole.
    assert len(starts.x0) == 12 * 19 - 42 - 12
    hole = (starts.time_s + 2 * DT_S) * RATE_HZ
    inside = (hole > 99.5) & (hole < 141.5)
    assert inside.any()
    assert np.isnan(found[inside, 1]).all()
    assert summary(found[:, 1], 2).starts == np.isfinite(found[:, 1, 0]).sum()
    assert summary(np.full((3, 4), np.nan), 1) is None


def test_the_mean_input_is_the_command_or_shared_between_two():
    trajectory = run(steps=4)
    u = trajectory.inputs
    assert mean_inputs(trajectory, np.array([50_000.0]), 50_000.0)[0] == pytest.approx(u[1])
    shared = mean_inputs(trajectory, np.array([40_000.0]), 50_000.0)[0]
    assert shared == pytest.approx(0.2 * u[0] + 0.8 * u[1])
    beyond = mean_inputs(trajectory, np.array([-25_000.0, 175_000.0, 300_000.0]), 50_000.0)
    assert beyond == pytest.approx(np.array([0.5 * u[0], 0.5 * u[3], [0.0, 0.0]]))


def test_along_the_trajectory_runs_are_averaged_at_equal_times():
    starts = starts_along([run(number=0), run(number=1, seed=1)], 2, DT_S, RATE_HZ)
    found = np.where(starts.run == 0, 1.0, 3.0)[:, None, None] * np.ones((1, 2, 4))
    found[0, 1] = np.nan
    times, mean, largest = errors_over_time(found, starts, 1.0 / RATE_HZ)
    assert times == pytest.approx(np.arange(12 * 39) / RATE_HZ)
    assert (mean[1:] == 2.0).all()
    assert (largest == 3.0).all()
    assert (mean[0, 0, 0], mean[0, 1, 0]) == (2.0, 3.0)


def test_a_surrogate_is_measured_with_and_without_reprojection():
    model, _ = train(ideal_dataset("kinematic"), "D5t")
    whole = run("kinematic", steps=1, change=20)
    # Of one input, a basis input, the surrogate is exact in either way.
    fixed = whole._replace(inputs=np.tile([0.2, 0.6], (20, 1)))
    nominal, x = robot_type("kinematic"), [np.array([0.1, 0.2, 3.0])]
    for _ in range(239):
        x.append(nominal.step(x[-1], fixed.inputs[0], 1.0 / RATE_HZ))
    starts = starts_along([fixed._replace(x=np.array(x))], 10, DT_S, RATE_HZ)
    for reproject in (True, False):
        found = rolling_deviations(by_model(model, reproject=reproject), starts, KINEMATIC)
        assert np.nanmax(found) < 1e-6
