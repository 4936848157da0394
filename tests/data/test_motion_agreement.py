"""The motion that poses show against the motion that is called for, window by window."""

import numpy as np
import pytest

from koopman_lab.data.called_for_motion import Motion
from koopman_lab.data.motion_agreement import compare_motion

RATE_HZ, V, OMEGA = 100.0, 0.3, 0.5


class Steady:
    """Says that the robot goes round at a constant speed, from one time to another."""

    def __init__(self, v=V, omega=OMEGA, until_us=2**62):
        self.v, self.omega, self.until_us = v, omega, until_us

    def between(self, begin_us, end_us):
        turn = self.omega * (end_us - begin_us) / 1e6
        arc = self.v / self.omega * (np.exp(1j * turn) - 1.0) / 1j
        unknown = end_us > self.until_us
        turn[unknown] = arc[unknown] = np.nan
        return Motion(arc, turn)

    def least(self, begin_us, end_us):
        raise AssertionError(f"nobody asks for {begin_us} to {end_us}")


def times(count, begin_us=0):
    return begin_us + np.arange(count, dtype=np.int64) * 10_000


def going_round(count, v=V, omega=OMEGA):
    theta = omega * np.arange(count) / RATE_HZ
    z = v / omega * np.exp(1j * theta) / 1j
    return np.column_stack([z.real, z.imag, np.remainder(theta + np.pi, 2.0 * np.pi) - np.pi])


def one_track(count):
    return np.zeros(count, np.intp)


def test_the_same_motion_agrees():
    contradicts, agreement = compare_motion(
        times(1000), going_round(1000), one_track(1000), [Steady()]
    )
    assert not contradicts.any()
    assert agreement.windows == 37  # one second each, four a second
    assert (agreement.contradicting, agreement.systematic) == (0, False)
    assert agreement.displacement.kept == pytest.approx(1.0)
    assert agreement.displacement.mirrored == pytest.approx(0.0, abs=1e-9)
    assert agreement.turn == pytest.approx(1.0)


@pytest.mark.parametrize(("v", "omega"), [(-V, OMEGA), (V, -OMEGA), (3 * V, OMEGA), (V, 3 * OMEGA)])
def test_another_motion_contradicts_throughout(v, omega):
    poses = going_round(1000, v, omega)
    contradicts, agreement = compare_motion(times(1000), poses, one_track(1000), [Steady()])
    assert contradicts.all()
    assert agreement.systematic
    # Along the chord of a second, whose angle hangs on the turn alone.
    if omega == OMEGA:
        assert agreement.displacement.kept == pytest.approx(v / V)
    assert agreement.turn == pytest.approx(omega / OMEGA)


def test_of_one_part_only_that_part_contradicts():
    """A body that stands for 3 s, of a track of its own, in 30 s of motion."""
    poses, track = going_round(3000), one_track(3000)
    poses[1500:1800], track[1500:1800] = poses[1500], 1
    contradicts, agreement = compare_motion(times(3000), poses, track, [Steady()])
    np.testing.assert_array_equal(contradicts, track == 1)
    assert 0 < agreement.contradicting < 0.15 * agreement.windows
    assert not agreement.systematic


def test_the_first_source_that_knows_is_asked():
    wrong = Steady(-V, until_us=10**12)
    knows = compare_motion(times(500), going_round(500), one_track(500), [wrong, Steady()])
    assert knows.contradicts.all()
    silent = Steady(-V, until_us=-1)
    passed = compare_motion(times(500), going_round(500), one_track(500), [silent, Steady()])
    assert not passed.contradicts.any()
    nobody = compare_motion(times(500), going_round(500), one_track(500), [silent])
    assert nobody.agreement.windows == 0
    assert not nobody.contradicts.any()


@pytest.mark.parametrize("count", [0, 1, 2, 20])
def test_too_few_frames_say_nothing(count):
    compared = compare_motion(times(count), going_round(count), one_track(count), [Steady()])
    assert compared.agreement.windows == 0
    assert not compared.contradicts.any()


def test_no_window_reaches_over_a_pause():
    """A session that goes on years later, by its stamps, of one track for all that is known."""
    utime = np.concatenate([times(300), times(300, 10**16)])
    poses = np.concatenate([going_round(300), going_round(300)])
    compared = compare_motion(utime, poses, one_track(600), [Steady()])
    assert compared.agreement.windows == 2 * 9
    assert not compared.contradicts.any()
