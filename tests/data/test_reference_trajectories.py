"""Reference runs are read from logs as they were driven."""

import numpy as np
import pytest
from older_messages import older
from synthetic_session import EPOCH_US

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, REFERENCE_STATE, SESSION_INFO
from koopman_lab.bus.message_values import padded
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.data.decode import SessionLog
from koopman_lab.data.reference_trajectories import reference_runs
from koopman_lab.errors import DataError
from koopman_lab.evaluation.metrics import by_nominal, per_step, rolling_deviations
from koopman_lab.evaluation.trajectory_starts import starts_along
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.geometry.planar import ORIGIN, Pose, compose, wrap_angle
from koopman_lab.robots.table import robot_type
from offboard.reference.shapes import Shape, input_sequence, start_pose

DT_US = 50_000
STAND_US = 250_000
"""Before and after each run."""
RUN = lcmtypes.reference_state_t.RUN


class Driven:
    """Two runs of the nominal robot and its exact cameras, from rest to rest."""

    def __init__(self, robot="dynamic", shape=Shape.INFINITY, runs=2):
        self.config = load_config(robot=robot, overrides=["reference.infinity.lap_s=2"])
        self.shape, self.inputs = shape, input_sequence(self.config, shape)
        self.start = np.zeros(robot_type(robot).state_dim)
        self.start[:3] = start_pose(self.config, shape)
        self.period_us = len(self.inputs) * DT_US + 2 * STAND_US
        self.states = [
            self._state(run, step) for run in range(runs) for step in range(len(self.inputs))
        ]
        self.frames = self._frames(runs)

    def _state(self, run, step):
        state = lcmtypes.reference_state_t()
        state.utime = EPOCH_US + run * self.period_us + STAND_US + step * DT_US
        state.sequence = run * len(self.inputs) + step
        state.phase, state.shape, state.run, state.step = RUN, self.shape, run, step
        state.steps = len(self.inputs)
        state.inputs, state.u = 2, padded(self.inputs[step], state.MOST_INPUTS)
        state.start_x1_m, state.start_x2_m, state.start_theta_rad = self.start[:3]
        return state

    def _frames(self, runs):
        model, knots = robot_type(self.config.robot.kind), [self.start]
        for u in self.inputs:
            knots.append(model.step(knots[-1], np.array(u), DT_US * 1e-6))
        frames = []
        for k in range(int(runs * self.period_us * 240 / 1e6)):
            frame = lcmtypes.mocap_pose_t()
            frame.utime, frame.sequence = EPOCH_US + round(k * 1e6 / 240), k
            since_us = (frame.utime - EPOCH_US) % self.period_us - STAND_US
            step = min(max(since_us // DT_US, 0), len(self.inputs))
            x = knots[step]
            if 0 <= since_us < len(self.inputs) * DT_US:
                x = model.step(x, np.array(self.inputs[step]), (since_us % DT_US) * 1e-6)
            frame.x1_m, frame.x2_m, frame.theta_rad = x[0], x[1], wrap_angle(float(x[2]))
            frame.tracking_valid = True
            frames.append(frame)
        return frames

    def log(self, folder, encode=lambda message: message.encode()):
        info = lcmtypes.session_info_t()
        info.utime, info.activity = EPOCH_US, "reference"
        info.config_yaml, info.version = dump_config(self.config), "test"
        rows = [(SESSION_INFO, info)]
        rows += [(MOCAP_POSE, m) for m in self.frames]
        rows += [(REFERENCE_STATE, m) for m in self.states]
        rows.sort(key=lambda row: row[1].utime)
        with EventLogWriter(folder / "a.lcm") as log:
            for channel, message in rows:
                data = encode(message) if channel is REFERENCE_STATE else message.encode()
                log.write(channel.name("R1"), data, message.utime)
        return SessionLog(folder / "a.lcm")


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_runs_recorded_with_two_inputs_are_the_same_to_the_last_bit(tmp_path, robot):
    driven = Driven(robot)
    new = reference_runs(driven.log(tmp_path)).trajectories(ORIGIN)
    (tmp_path / "old").mkdir()
    old = reference_runs(driven.log(tmp_path / "old", older)).trajectories(ORIGIN)
    for before, now in zip(old, new, strict=True):
        for one, other in zip(before, now, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_states_and_inputs_are_those_driven(tmp_path, robot):
    driven = Driven(robot)
    runs = reference_runs(driven.log(tmp_path))
    assert (runs.shape, len(runs.trajectories(ORIGIN))) == ("infinity", 2)
    assert runs.start == pytest.approx(driven.start)
    for k, t in enumerate(runs.trajectories(ORIGIN)):
        assert np.array_equal(t.inputs, driven.inputs)
        assert t.start_us == EPOCH_US + k * driven.period_us + STAND_US
        assert t.end_us - t.start_us == len(driven.inputs) * DT_US
        # Also the first and the last frame of the run have whole windows.
        assert t.utime_us[0] <= t.start_us
        assert t.utime_us[-1] >= t.end_us
    starts = starts_along(runs.trajectories(ORIGIN), 20, 0.05, 240.0)
    last = per_step(rolling_deviations(by_nominal(runs.robot, 0.05), starts, runs.robot))[-1]
    # Smoothing moves a kink of a velocity by an eighth of the window, per unit of the kink.
    kink = np.abs(np.diff([(0.0, 0.0), *driven.inputs, (0.0, 0.0)], axis=0)).max(axis=0)
    v, omega = kink * 40 / 240 / 8 if robot == "dynamic" else (0.0, 0.0)
    assert last.starts > 2 * (len(driven.inputs) - 21) * 12
    assert last.angle_max_rad < 1.1 * omega + 1e-6
    assert last.position_max_m < 1.1 * (v + omega * 0.2) + 2e-3


def test_a_run_that_was_cut_off_or_that_the_log_lost_a_step_of_is_left_out(tmp_path):
    driven = Driven(runs=3)
    steps = len(driven.inputs)
    del driven.states[-5:], driven.states[7]
    runs = reference_runs(driven.log(tmp_path))
    assert [t.start_us for t in runs.trajectories(ORIGIN)] == [
        EPOCH_US + driven.period_us + STAND_US
    ]
    assert [t.number for t in runs.trajectories(ORIGIN)] == [0]
    assert len(runs.trajectories(ORIGIN)[0].inputs) == steps


def test_an_acceleration_ends_with_its_interval_though_the_next_command_is_late(tmp_path):
    driven = Driven(runs=1)
    for state in driven.states[30:]:
        state.utime += 60_000
    late = reference_runs(driven.log(tmp_path)).trajectories(ORIGIN)[0]
    assert late.command_us[30] - late.command_us[29] == DT_US
    assert late.inputs[30] == pytest.approx([0.0, 0.0])
    assert np.array_equal(np.delete(late.inputs, 30, axis=0), driven.inputs)


def test_a_log_without_complete_runs_is_refused(tmp_path):
    driven = Driven(runs=1)
    del driven.states[-1]
    with pytest.raises(DataError, match=r"R1_REFERENCE_STATE: no complete .*klab reference"):
        reference_runs(driven.log(tmp_path))


def test_two_shapes_in_a_log_are_refused(tmp_path):
    driven = Driven()
    for state in driven.states[len(driven.inputs) :]:
        state.shape = Shape.SQUARE
    with pytest.raises(DataError, match="several shapes"):
        reference_runs(driven.log(tmp_path))


def test_a_model_that_knows_where_the_markers_are_sees_the_robot(tmp_path):
    """The markers' poses, seen by such a model, are those that markers on the axle would show."""
    driven, offset = Driven(runs=1), Pose(0.03, -0.02, 0.1)
    plain = reference_runs(driven.log(tmp_path)).trajectories(ORIGIN)[0]
    for frame in driven.frames:
        seen = compose(Pose(frame.x1_m, frame.x2_m, frame.theta_rad), offset)
        frame.x1_m, frame.x2_m, frame.theta_rad = seen
    (tmp_path / "moved").mkdir()
    robot = reference_runs(driven.log(tmp_path / "moved")).trajectories(offset)[0]
    assert np.array_equal(robot.utime_us, plain.utime_us)
    assert np.abs(robot.x - plain.x).max() < 1e-9
