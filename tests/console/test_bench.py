import pytest
from klab import klab_json, klab_ok


def test_bench_lockstep_says_how_fast_and_on_what():
    facts = klab_json("bench", "lockstep", "--seconds", "3", "--robot", "dynamic")
    factors = facts["times_real_time"]
    assert 0.0 < factors["p99"] <= factors["median"]
    assert sum(facts["share"].values()) == pytest.approx(1.0)
    # Every part works, also the commander: the robot is driven, not standing.
    assert {"motors, body, encoders", "cameras", "motor loop", "runner"} <= set(facts["share"])
    assert facts["driving"]


def test_bench_lockstep_as_a_table():
    text = klab_ok("bench", "lockstep", "--seconds", "2", "--preset", "harsh")
    assert "times real time" in text
    assert "encoding and decoding" in text
