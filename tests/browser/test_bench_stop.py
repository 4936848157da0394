"""`klab bench stop` presses a real key and a real button."""

import pytest
from klab import MODEL, klab_json


@pytest.mark.parametrize("driven", [(), ("--model", MODEL)], ids=["weave", "park"])
def test_both_ways_of_stopping_are_timed_from_the_press(driven, tmp_path):
    stops = klab_json("bench", "stop", "--presses", "2", *driven, "--out", tmp_path / "stop")
    assert [one["by"] for one in stops] == ["space bar", "button"]
    for one in stops:
        assert one["v_m_per_s"] or one["omega_rad_per_s"]
        assert 0.0 <= one["zero_ms"] <= one["stood_ms"]
