"""`klab bench soak`: what counts as moving without permission, and one strike in real time."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st
from klab import MODEL, klab_json, start_klab
from real_bus import Ear

from koopman_lab.robots.table import ROBOTS
from offboard.bench.faults.stage import TruthSample
from offboard.bench.soak.permission import Permission, forbidden_way_m
from offboard.bench.soak.resources import ResourceWatch
from offboard.bench.soak.strikes import strikes_for

HALF_TRACK_M = 0.06
SECOND = 1_000_000


def drive(v, omega, seconds, rate_hz=100):
    """Return the truth of a robot at constant speeds."""
    count = round(seconds * rate_hz)
    return [
        TruthSample(k * SECOND // rate_hz, v * k / rate_hz, 0.0, 0.0, v, omega)
        for k in range(count + 1)
    ]


@given(
    st.floats(-1.0, 1.0),
    st.floats(-3.0, 3.0),
    st.lists(st.tuples(st.integers(0, 400), st.integers(0, 400)), max_size=4),
)
def test_the_forbidden_way_is_speed_times_time_outside_of_all_permissions(v, omega, spans):
    spans = [Permission(min(s) * 10_000, max(s) * 10_000) for s in spans]
    outside = sum(
        not any(span.begin_us <= k * 10_000 < span.end_us for span in spans) for k in range(400)
    )
    way = (abs(v) + HALF_TRACK_M * abs(omega)) * outside * 0.01
    assert forbidden_way_m(drive(v, omega, 4.0), spans, HALF_TRACK_M) == pytest.approx(way)


def test_a_robot_that_a_hand_places_anew_has_not_driven():
    sights = [TruthSample(k, 10.0 * k, 0.0, 0.0, 0.0, 0.0) for k in range(5)]
    assert forbidden_way_m(sights, (), HALF_TRACK_M) == 0.0


def test_what_a_process_holds_is_seen_until_it_has_ended():
    watch, pipes = ResourceWatch(), []
    watch.look("self", os.getpid())
    pipes = os.pipe()
    watch.look("self", os.getpid())
    for end in pipes:
        os.close(end)
    watch.look("nobody", 2**22 + 1)
    (own,) = watch.longest()
    assert (own.name, own.looks) == ("self", 2)
    assert own.last_descriptors == own.first_descriptors + 2
    assert 0.0 < own.first_mb <= 2.0 * own.last_mb


@pytest.mark.parametrize("robot", list(ROBOTS), ids=lambda robot: robot.name)
def test_each_strike_has_one_name_and_every_kind_of_robot_is_struck(robot):
    names = [(strike.name, strike.activity) for strike in strikes_for(robot)]
    assert len(names) == len(set(names)) > 50


def test_nobody_is_left_behind_by_a_soak_that_is_killed(bus_url, tmp_path):
    soak = start_klab("bench", "soak", "--model", MODEL, "--out", tmp_path / "soak")
    ear = Ear(bus_url)
    pids = ear.wait_for("plant", "onboard")
    soak.kill()
    soak.wait()
    soak.stdout.close()
    ear.wait_until_gone(pids)


def test_a_lab_is_struck_in_real_time_and_comes_back(tmp_path):
    short = ("--minutes", "0.4", "--every-s", "0", "--seed", "0", "--out", tmp_path / "soak")
    soaked = klab_json("bench", "soak", "--model", MODEL, *short)
    assert soaked["driven_m"] > 0.1
    assert {row["forbidden_m"] for row in soaked["strikes"]} == {0.0}
    assert {row["beyond_floor_m"] for row in soaked["strikes"]} == {0.0}
    assert {"plant", "onboard", "view"} <= {seen["name"] for seen in soaked["resources"]}
