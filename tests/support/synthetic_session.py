"""Session logs of a robot that obeys the nominal equations exactly, seen by exact cameras."""

from itertools import pairwise

import numpy as np

import lcmtypes
from koopman_lab.bus.channels import MOCAP_POSE, SAMPLER_STATE, SESSION_INFO
from koopman_lab.bus.message_values import padded
from koopman_lab.config.load import dump_config, load_config
from koopman_lab.eventlog.logwriter import EventLogWriter
from koopman_lab.geometry.planar import wrap_angle
from koopman_lab.robots.table import robot_type

EPOCH_US = 1_700_000_000_000_000
BASIS, BRAKE = lcmtypes.sampler_state_t.BASIS, lcmtypes.sampler_state_t.BRAKE


class Session:
    """Runs under the basis inputs, a pause between any two; times in us since ``EPOCH_US``."""

    def __init__(self, kind, segments=4, run_s=1.0, overrides=(), seed=3):
        self.config = load_config(
            robot=kind,
            overrides=["processing.discard_start_s=0", *overrides],
        )
        self.model = robot_type(kind)
        self.dt_us = round(self.config.controller.dt_s * 1e6)
        self.inputs = self.config.sampler.indexed_inputs
        rng = np.random.default_rng(seed)
        low = np.array([0.0, -0.7, -np.pi, 0.0, -1.0][: self.model.state_dim])
        high = np.array([1.5, 0.7, np.pi, 0.4, 1.0][: self.model.state_dim])
        steps = round(run_s * 1e6 / self.dt_us)
        # Runs begin at odd times, so that no command coincides with a frame.
        period = (steps + 10) * self.dt_us
        self.runs = []
        for number in range(segments * len(self.inputs)):
            index = list(self.inputs)[number % len(self.inputs)]
            start = 101_234 + number * period
            x0 = rng.uniform(low, high)
            self.runs.append((number, index, start, start + steps * self.dt_us, x0))
        end = self.runs[-1][3] + 5 * self.dt_us
        rate = self.config.mocap.rate_hz
        self.frames = [self._frame(k, round(k * 1e6 / rate)) for k in range(int(end * rate / 1e6))]
        self._put_runs_into_frames()
        self.states = [
            self._state(count, time) for count, time in enumerate(range(1_234, end, self.dt_us))
        ]

    def _frame(self, sequence, time):
        frame = lcmtypes.mocap_pose_t()
        frame.utime, frame.sequence = EPOCH_US + time, sequence
        # Between the runs the robot is nowhere near: whatever leaks from there is seen.
        frame.x1_m, frame.x2_m, frame.theta_rad = 50.0, 50.0 + sequence, 1.0
        frame.tracking_valid = True
        return frame

    def _put_runs_into_frames(self):
        for _, index, start, end, x0 in self.runs:
            inside = [f for f in self.frames if start <= f.utime - EPOCH_US <= end]
            times = [start, *(f.utime - EPOCH_US for f in inside)]
            x, u = x0, np.array(self.inputs[index])
            for (before, now), frame in zip(pairwise(times), inside, strict=True):
                x = self.model.step(x, u, (now - before) / 1e6)
                frame.x1_m, frame.x2_m, frame.theta_rad = x[0], x[1], wrap_angle(x[2])

    def _state(self, sequence, time):
        state = lcmtypes.sampler_state_t()
        state.utime, state.sequence, state.phase = EPOCH_US + time, sequence, BRAKE
        for number, index, start, end, _ in self.runs:
            state.segments_done += end <= time
            if start <= time < end:
                state.phase, state.segment, state.basis_index = BASIS, number, index
                u = self.inputs[index]
                state.inputs, state.u = len(u), padded(u, state.MOST_INPUTS)
        return state

    def truth(self, index, utime):
        """Return the state (n,) at a time inside a run under a basis input."""
        for _, i, start, end, x0 in self.runs:
            if i == index and start <= utime - EPOCH_US <= end:
                x, steps = x0, 200
                for _ in range(steps):
                    dt_s = (utime - EPOCH_US - start) / 1e6 / steps
                    x = self.model.step(x, np.array(self.inputs[index]), dt_s)
                return x
        raise ValueError(utime)

    def messages(self):
        """Return (channel name, bytes, utime), in order of utime."""
        info = lcmtypes.session_info_t()
        info.utime, info.activity = EPOCH_US, "calibrate"
        info.config_yaml, info.version = dump_config(self.config), "test"
        rows = [(SESSION_INFO, info)]
        rows += [(MOCAP_POSE, frame) for frame in self.frames]
        rows += [(SAMPLER_STATE, state) for state in self.states]
        rows.sort(key=lambda row: row[1].utime)
        return [(channel.name("R1"), m.encode(), m.utime) for channel, m in rows]

    def write(self, path, messages=None):
        """Write the log; the messages arrive when they are sent."""
        with EventLogWriter(path) as log:
            for channel, data, utime in self.messages() if messages is None else messages:
                log.write(channel, data, utime)
        return path
