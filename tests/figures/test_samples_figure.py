"""The figure of samples shows what is in the session."""

import csv

import numpy as np
import pytest
from synthetic_session import Session

from koopman_lab.data.decode import SessionLog
from koopman_lab.data.recording import recording
from koopman_lab.data.segments import Run, Segment
from koopman_lab.errors import DataError
from koopman_lab.figures.samples_figure import draw_samples, shown_inputs, smoothed
from koopman_lab.robots.table import robot_type

RATE_HZ = 240.0


def turning(frames, v=0.2, omega=0.5):
    """Return a segment on a circle, its angle passing pi."""
    times = np.arange(frames) / RATE_HZ
    theta = 3.0 + omega * times
    poses = np.column_stack([np.sin(theta), -np.cos(theta), theta])
    poses[:, :2] *= v / omega
    poses[:, 2] = np.angle(np.exp(1j * theta))
    return Segment(Run(0, 1, (0.0, 0.0), 0, 0), np.rint(times * 1e6).astype(np.int64) + 77, poses)


@pytest.mark.parametrize("window", [1, 10, 11, 100])
def test_a_circle_has_constant_velocities_whatever_the_window(window):
    rows = smoothed(turning(300), window)
    assert len(rows) == 300 - 2 - 2 * (window // 2)
    assert rows[0, 0] == pytest.approx((1 + window // 2) / RATE_HZ, abs=2e-6)
    # Stamps are whole microseconds, and so is the error of each difference.
    assert rows[:, 1] == pytest.approx(np.full(len(rows), 0.2), rel=1e-3)
    assert rows[:, 2] == pytest.approx(np.full(len(rows), 0.5), rel=1e-3)


@pytest.fixture(scope="module", params=["kinematic", "dynamic"])
def recorded(request, tmp_path_factory):
    session = Session(request.param, segments=2, run_s=1.0)
    path = session.write(tmp_path_factory.mktemp(request.param) / "session.lcm")
    return recording(SessionLog(path))


def test_every_run_and_every_window_is_shown(recorded, tmp_path):
    shown = shown_inputs(recorded, (10, 40))
    assert [part.basis_index for part in shown] == list(recorded.config.sampler.indexed_inputs)
    for part in shown:
        own = recorded.segments_of(part.basis_index)
        assert [run for run, _ in part.paths] == [s.run.number for s in own]
        # A point each 50 ms: the path of a second has twenty.
        assert {len(path) for _, path in part.paths} == {20}
        assert list(part.velocities) == [10, 40]
    draw_samples(tmp_path / "samples", shown, robot_type(recorded.config.robot.kind))
    assert {p.name for p in tmp_path.iterdir()} == {
        *("samples.pdf", "samples.png", "samples-positions.csv", "samples-velocities.csv")
    }
    with (tmp_path / "samples-velocities.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == sum(len(v) for part in shown for v in part.velocities.values())
    first = shown[0].velocities[10][0]
    assert [float(lines[0][c]) for c in ("time_s", "v_m_per_s", "omega_rad_per_s")] == list(first)
    with (tmp_path / "samples-positions.csv").open() as file:
        points = list(csv.DictReader(file))
    assert len(points) == 2 * 20 * len(shown)


def test_a_window_wider_than_every_segment_is_refused(recorded):
    with pytest.raises(DataError, match=r"session\.lcm: .* has 2\d\d frames, a window of 500"):
        shown_inputs(recorded, (10, 500))
