"""One node once more on recorded inputs: the regression test for every change of a node."""

import json

import pytest
from klab import MODEL, OLDER, REFERENCE, SMALL_AREA, klab, klab_ok
from older_messages import rewritten

from koopman_lab.bus.channels import SAMPLER_STATE

SPOKEN = {
    "sampler": {
        *("INTERLOCK", "SAMPLER_HEARTBEAT", "SAMPLER_STATE"),
        *("SESSION_INFO", "TIME_PONG", "VELOCITY_CMD"),
    },
    "controller": {
        *("CONTROLLER_HEARTBEAT", "INTERLOCK", "MPC_STATE"),
        *("SESSION_INFO", "TIME_PONG", "VELOCITY_CMD"),
    },
    "onboard": {
        *("MOTOR_CMD", "ONBOARD_HEARTBEAT", "ONBOARD_STATUS"),
        *("TIME_PING", "TIME_SYNC", "WHEEL_STATE"),
    },
}
ROUNDING = "1e-6"
"""Between processors with other instructions for sines and linear algebra."""


def again(log, node, *arguments):
    if node == "controller":
        arguments = (*arguments, "--model", MODEL)
    done = klab("rerun", log, "--node", node, *arguments, "--json")
    assert done.returncode in (0, 1), done.stderr
    facts = json.loads(done.stdout)
    assert (done.returncode == 0) == (not differing(facts))
    return facts


def differing(facts):
    return facts["different"] + facts["missing"] + facts["extra"]


@pytest.mark.parametrize(
    ("log", "node"),
    [
        ("calibration", "sampler"),
        ("calibration", "onboard"),
        ("park", "controller"),
        ("park", "onboard"),
    ],
)
def test_the_node_says_what_it_said_when_the_reference_was_recorded(log, node):
    """Where this is meant to fail, `scripts/reference` records anew."""
    facts = again(REFERENCE / f"{log}.lcm", node, "--tolerance", ROUNDING)
    assert facts["differences"] == []
    assert differing(facts) == 0
    assert set(facts["channels"]) == {f"R1_{suffix}" for suffix in SPOKEN[node]}
    assert all(channel["equal"] > 0 for channel in facts["channels"].values())


@pytest.mark.parametrize("folder", [REFERENCE, OLDER], ids=lambda folder: folder.name)
def test_each_reference_is_small(folder):
    assert max(file.stat().st_size for file in folder.iterdir()) < 600_000


BAD_RADIO = [
    *(
        "--set",
        "simulation.radio.to_robot.loss=0.05",
        "--set",
        "simulation.radio.to_robot.duplication=0.05",
    ),
    *(
        "--set",
        "simulation.radio.from_robot.reordering=0.05",
        "--set",
        "simulation.radio.from_robot.duplication=0.05",
    ),
    *(
        "--set",
        "simulation.radio.to_robot.burst_rate_hz=0.1",
        "--set",
        "simulation.clock.offset_s=-30",
    ),
]
FAULTS = (
    "--set",
    "simulation.faults=[{kind: burst_loss, at_s: 2.0, duration_s: 0.5},"
    " {kind: clock_jump, at_s: 4.0, duration_s: 1.0}]",
)
CONDITIONS = {
    "lab": (),
    "no delay": ("--preset", "ideal"),
    "bad radio": BAD_RADIO,
    "second order": ("--robot", "dynamic", "--preset", "harsh"),
    "faults": FAULTS,
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_session_in_lockstep_comes_out_the_same_to_the_last_bit(condition, tmp_path):
    out = tmp_path / "calibration"
    small = ("--segments", "1", *SMALL_AREA, *CONDITIONS[condition])
    klab("calibrate", "--lockstep", *small, "--out", out)
    for node in ("sampler", "onboard"):
        facts = again(out, node)
        assert facts["lockstep"]
        assert facts["tolerance"] == 0.0
        assert differing(facts) == facts["beyond"] == 0, facts["differences"]
        assert facts["equal"] > 500


def test_a_park_in_lockstep_comes_out_the_same_to_the_last_bit(tmp_path):
    out = tmp_path / "park"
    start, goal = ("-0.2", "0.05", "10"), ("0.1", "0", "20")
    klab_ok(
        *("park", "--model", MODEL, "--start", *start, "--goal", *goal),
        *("--set", "controller.use_compiler=false", "--lockstep", "--out", out),
    )
    for node in ("controller", "onboard"):
        facts = again(out, node)
        assert differing(facts) == 0, facts["differences"]


@pytest.mark.parametrize("shape", ["infinity", "square"])
def test_a_reference_run_in_lockstep_comes_out_the_same_to_the_last_bit(shape, tmp_path):
    out = tmp_path / shape
    klab_ok("reference", "--shape", shape, "--runs", "1", "--lockstep", "--out", out)
    for node in ("reference", "onboard"):
        facts = again(out, node)
        assert differing(facts) == facts["beyond"] == 0, facts["differences"]
        assert facts["equal"] > 500


def test_a_change_is_counted_first_and_then_shown_field_by_field(tmp_path):
    config = tmp_path / "changed.yaml"
    config.write_text(
        "robot: {kind: kinematic}\nseed: 1\n"
        "motor_loop: {pid: {proportional: 0.031}}\nmocap: {rate_hz: 40}\n"
    )
    log = REFERENCE / "calibration.lcm"
    done = klab("rerun", log, "--node", "onboard", "--config", config, "--tolerance", ROUNDING)
    assert done.returncode == 1, done.stderr
    table, _, listing = done.stdout.partition("R1_MOTOR_CMD number")
    assert "different" in table
    assert "left_duty" in listing
    assert " -> " in listing
    facts = again(log, "onboard", "--config", config, "--tolerance", ROUNDING)
    assert facts["channels"]["R1_MOTOR_CMD"]["different"] > 100
    assert facts["channels"]["R1_TIME_PING"]["different"] == 0
    assert set(facts["differences"][0]["fields"]) <= {"left_duty", "right_duty"}


def test_one_changed_missing_and_added_message_are_each_found(tmp_path):
    def change(event):
        if event.channel != "R1_SAMPLER_STATE":
            return event.data
        state = SAMPLER_STATE.type.decode(event.data)
        if state.sequence == 20:
            return None
        if state.sequence == 30:
            state.segment += 1
        if state.sequence == 40:
            state.sequence = 100_000
        return state.encode()

    log = rewritten(REFERENCE / "calibration.lcm", tmp_path / "changed.lcm", change)
    facts = again(log, "sampler", "--tolerance", ROUNDING)
    channel = facts["channels"]["R1_SAMPLER_STATE"]
    assert (channel["different"], channel["missing"], channel["extra"]) == (1, 1, 2)
    (difference,) = facts["differences"]
    assert difference["number"] == 30
    assert set(difference["fields"]) == {"segment"}


def test_a_missing_input_is_noticed(tmp_path):
    log = rewritten(
        REFERENCE / "calibration.lcm",
        tmp_path / "changed.lcm",
        lambda e: None if e.channel == "R1_MOCAP_POSE" else e.data,
    )
    facts = again(log, "sampler")
    assert facts["channels"]["R1_SAMPLER_STATE"]["different"] > 100


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("{park}", "--node", "controller"), "--model"),
        (("{log}", "--node", "controller"), "R1_CONTROLLER_HEARTBEAT: not in the log"),
        (("{park}", "--node", "sampler"), "R1_SAMPLER_HEARTBEAT: not in the log"),
        (("{log}", "--node", "sampler", "--config", "{other}"), "configures R7"),
        (("{none}", "--node", "sampler"), "no such log"),
    ],
)
def test_mistakes_are_one_message(arguments, words, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text("robot: {name: R7}\n")
    places = {
        "log": REFERENCE / "calibration.lcm",
        "park": REFERENCE / "park.lcm",
        "other": other,
        "none": tmp_path / "none.lcm",
    }
    done = klab("rerun", *(str(a).format(**places) for a in arguments))
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("klab: ") == 1
