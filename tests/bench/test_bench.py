import importlib.util
import json

import pytest
from klab import MODEL, NO_RADIO_LOSS, klab, klab_json, klab_ok

from koopman_lab.data.decode import SessionLog


def test_bench_lockstep_says_how_fast_and_on_what():
    facts = klab_json("bench", "lockstep", "--seconds", "3", "--robot", "dynamic")
    factors = facts["times_real_time"]
    assert 0.0 < factors["p99"] <= factors["median"] <= factors["best"]
    assert sum(facts["share"].values()) == pytest.approx(1.0)
    # Every part works, also the commander: the robot is driven, not standing.
    assert {"motors, body, encoders", "cameras", "motor loop", "runner"} <= set(facts["share"])
    assert facts["driving"]


def test_bench_lockstep_as_a_table():
    text = klab_ok("bench", "lockstep", "--seconds", "2", "--preset", "harsh")
    assert "times real time" in text
    assert "noise: the best chunk" in text
    assert "encoding and decoding" in text


def test_bench_authentication_says_what_the_key_costs():
    facts = klab_json("bench", "authentication", "--messages", "300")
    for costs in facts["cost_us"].values():
        assert set(costs) == {"encode", "sign", "verify", "take"}
        for cost in costs.values():
            assert 0.0 < cost["median"] <= cost["p99"] <= cost["max"]
    assert facts["share_of_a_core_at_240_hz"]["sign"] > 0.0
    lockstep = facts["lockstep"]
    # Frames, counters and duties alone are 440 a second, and each is heard by somebody.
    assert lockstep["signed_per_s"] > 440.0
    assert lockstep["verified_per_s"] > 200.0
    assert lockstep["share"] > 0.0
    assert "in lockstep" in klab_ok("bench", "authentication", "--messages", "100")


def test_bench_logger_counts_both_loggers_on_one_bus(tmp_path):
    short = ("--minutes", "0.05", "--camera-rate-hz", "240", *NO_RADIO_LOSS)
    found = klab_json("bench", "logger", *short, "--out", tmp_path / "run")
    assert set(found) == {"klab run logger", "lcm-logger"}
    ours = found["klab run logger"]
    assert ours["lost"] == ours["camera_frames_lost"] == 0
    for name, log in (("klab run logger", "session.lcm"), ("lcm-logger", "lcm-logger.lcm")):
        row, channels = found[name], SessionLog(tmp_path / "run" / log).channels
        assert row["camera_frames"] == channels["R1_MOCAP_POSE"].count > 3 * 240
        assert row["events"] == sum(channel.count for channel in channels.values())
        assert 0.0 <= row["cpu_share"] < 2.0
        assert row["memory_mb"] > 1.0


@pytest.mark.parametrize("preset", ["lab", "harsh"])
def test_bench_motor_shows_the_responses_and_they_are_as_the_motor_loop_promises(preset, tmp_path):
    merit = klab_json("bench", "motor", "--preset", preset)
    assert merit["step_settled_s"] <= 0.4
    assert merit["step_overshoot"] < 0.10
    assert merit["ramp_rms_m_per_s"] < 0.010
    assert 0.0 < merit["disturbance_dip_m_per_s"] < 0.1
    assert merit["disturbance_left_m_per_s"] < 0.02 * 0.3
    assert "overshoot" in klab_ok("bench", "motor", "--out", tmp_path / "motor")
    assert {p.name for p in tmp_path.iterdir()} == {"motor.pdf", "motor.png"}


def test_bench_edmd_compares_with_others_and_streams():
    size = ("--pairs", "2000", "--repetitions", "2", "--streamed", "120000")
    facts = klab_json("bench", "edmd", *size)
    for way in ("fit", "pykoop", "gram", "lift"):
        times = facts[way]["time_s"]
        assert 0.0 < times["median"] <= times["p99"] <= times["max"]
    assert facts["fit_to_pykoop"]["time"] > 0.0
    assert facts["streamed"]["pairs"] == 120_000
    assert facts["streamed"]["peak_rss_bytes"] > 0


def test_bench_ocp_has_a_row_for_each_solver_there_is():
    wanted = ("--model", MODEL, "--states", "3", "--set", "controller.horizon=4")
    done = klab("bench", "ocp", *wanted, "--json")
    assert done.returncode == 0, done.stderr
    there = importlib.util.find_spec("do_mpc") is not None
    assert there == ("do-mpc is not installed" not in done.stderr)
    rows = json.loads(done.stdout)
    solvers = ["ours", "ipopt", *(["do-mpc"] if there else [])]
    assert [(row["model"], row["solver"]) for row in rows] == [
        (model, solver) for model in ("reprojected", "lifted") for solver in solvers
    ]
    for row in rows:
        assert row["problem"] == "kinematic"
        assert 0.0 < row["median_ms"] <= row["p99_ms"] <= row["max_ms"]
        assert row["worse_share"] == len(row["exceptions"]) / 3
        for exception in row["exceptions"]:
            assert exception["value"] > exception["best"]
            assert exception["ours_from_best"] <= exception["best"] * (1.0 + 1e-6)


def test_bench_parks_counts_where_the_robot_truly_stands():
    short = ("--set", "controller.horizon=25", "--set", "controller.time_limit_s=8")
    rows = klab_json("bench", "parks", "--model", MODEL, "--runs", "2", *short)
    assert [row["controller"] for row in rows] == ["koopman", "koopman, offset-free", "nominal"]
    assert {row["runs"] for row in rows} == {2}
    for row in rows:
        assert 0.0 <= row["within_share"] <= 1.0
        assert row["x2_median_mm"] <= row["x2_max_mm"]
    again = klab_json("bench", "parks", "--model", MODEL, "--runs", "2", *short)
    assert again == rows


def test_bench_view_counts_what_the_page_costs_and_that_nothing_is_lost(tmp_path):
    short = ("--minutes", "0.1", "--clients", "3")
    found = klab_json("bench", "view", *short, "--out", tmp_path / "view")
    assert 0.0 < found["cpu_share"] < 1.0
    assert all(20.0 < mb < 500.0 for mb in found["memory_mb"])
    assert found["lost"] == 0
    assert found["messages"] > 1000
    p50, p99, longest = found["snapshot_ms"]
    assert 0.0 < p50 <= p99 <= longest


def test_bench_flood_sees_nobody_die_and_nothing_lost(tmp_path):
    rows = klab_json("bench", "flood", "--minutes", "0.05", "--out", tmp_path / "flood")
    assert list(rows) == ["without a flood", "flooded"]
    quiet, flooded = rows.values()
    assert quiet["datagrams"] == quiet["refused"] == 0
    assert flooded["datagrams"] > 1000
    assert flooded["refused"] > 0
    for row, run in ((quiet, "quiet"), (flooded, "flooded")):
        assert row["death"] == ""
        assert row["camera_frames_lost"] == row["lost"] == 0
        cameras = SessionLog(tmp_path / "flood" / run / "session.lcm", salvage=True).channels[
            "R1_MOCAP_POSE"
        ]
        assert row["camera_frames"] == cameras.count - cameras.unreadable > 3 * 240
        for cost in (row["cpu_share"], row["memory_mb"]):
            assert set(cost) == {"plant", "onboard", "logger", "sampler"}
            assert min(cost.values()) > 0.0


def test_bench_realtime_shows_motor_loop_and_machine_side_by_side(tmp_path):
    found = klab_json("bench", "realtime", "--minutes", "0.05", "--out", tmp_path / "run")
    for name in ("onboard", "pacer"):
        row = found[name]
        assert row["ticks"] + row["missed"] >= 300
        assert row["missed_share"] == pytest.approx(row["missed"] / (row["ticks"] + row["missed"]))
        assert 0.0 < row["period_p50_ms"] <= row["period_p99_ms"] <= row["period_max_ms"]


def test_the_bench_of_the_stop_command_hears_its_first_message_beside_busy_loops():
    rows = klab_json("bench", "estop", "--tries", "1", "--load", "0", "--load", "2")
    assert [row["load"] for row in rows] == [0, 2]
    for row in rows:
        assert 0.0 < row["cpu_s"] <= row["wall_s"]


def test_bench_start_times_help_and_completion_beside_the_library():
    rows = klab_json("bench", "start", "--rounds", "1")
    commands = [row["command"] for row in rows]
    assert commands[:2] == ["python -c 'import typer'", "klab --help"]
    assert any("[TAB]" in command for command in commands)
    assert (rows[0]["wall_ratio"], rows[0]["cpu_ratio"]) == (1.0, 1.0)
    for row in rows:
        assert row["cpu_s"] > 0.0
        assert row["wall_ratio"] == row["wall_s"] / rows[0]["wall_s"]
