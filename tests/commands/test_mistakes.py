"""Expected mistakes: one message that names what and where, and nothing half-written."""

import pytest
from klab import environment, klab, klab_json, klab_ok

from offboard.terminal.exit_codes import ExitCode


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Make a session with too few samples, one that is complete, its model, and bad files."""
    folder = tmp_path_factory.mktemp("runs")
    short = ("calibrate", "--lockstep", "--segments", "1", "--out", folder / "short")
    assert klab(*short).returncode == 0
    klab_ok("calibrate", "--lockstep", "--out", folder / "good")
    klab_ok("train", folder / "good", "--out", folder / "model.npz")
    whole = (folder / "good" / "session.lcm").read_bytes()
    (folder / "cut.lcm").write_bytes(whole[: len(whole) * 9 // 10])
    (folder / "text.lcm").write_text("not a log\n" * 100)
    (folder / "empty.lcm").touch()
    # From the beginning of an event: within one they could be its own numbers.
    half = whole.index(bytes.fromhex("eda1da01"), len(whole) // 2)
    (folder / "zeros.lcm").write_bytes(whole[:half] + bytes(300) + whole[half + 300 :])
    (folder / "lab.yaml").write_text("controller:\n  horizont: 40\n")
    (folder / "range.yaml").write_text("controller:\n  horizon: -3\n")
    (folder / "broken.npz").write_bytes((folder / "model.npz").read_bytes()[:200])
    klab_ok("dataset", "make", folder / "good", "--out", folder / "data.npz")
    klab_ok("dataset", "export", folder / "data.npz", "--out", folder / "dat")
    (folder / "theirs").mkdir()
    for name in ("X_1.dat", "Y_1.dat", "X_2.dat"):
        (folder / "theirs" / name).write_bytes((folder / "dat" / name).read_bytes())
    return folder


CASES = {
    "misspelt key": (
        ("calibrate", "--lockstep", "--config", "{runs}/lab.yaml"),
        ("lab.yaml:2", "controller.horizont", "did you mean controller.horizon?"),
    ),
    "out of range": (
        ("calibrate", "--lockstep", "--config", "{runs}/range.yaml"),
        ("range.yaml:2", "controller.horizon", "found -3"),
    ),
    "override": (
        ("park", "--model", "{runs}/model.npz", "--lockstep", "--set", "controller.cost=xx"),
        ("--set controller.cost=xx", "controller.cost", "'me'"),
    ),
    "cost": (
        ("park", "--model", "{runs}/model.npz", "--lockstep", "--cost", "nothing"),
        ("unknown cost 'nothing', known: me, ce, ds",),
    ),
    "goal off the floor": (
        ("park", "--model", "{runs}/model.npz", "--lockstep", "--goal", "30", "0", "0"),
        ("x1 = 30 m is outside [-2.5, 2.5] m", "floor.x1_m"),
    ),
    "goal that nobody drives to": (
        ("goal", "0.1", "0", "0"),
        ("R1_MPC_STATE is silent", "klab park"),
    ),
    "channel that is none": (
        ("topics", "--echo", "R1_NONE"),
        ("'R1_NONE' is not of this lab", "MOCAP_POSE"),
    ),
    "missing log": (
        ("train", "{runs}/none.lcm"),
        ("none.lcm", "no such"),
    ),
    "truncated log": (
        ("train", "{runs}/cut.lcm", "--out", "{out}"),
        ("cut.lcm", "byte", "--salvage"),
    ),
    "truncated log info": (
        ("log", "info", "{runs}/cut.lcm"),
        ("cut.lcm", "byte", "--salvage"),
    ),
    "no log at all": (
        ("log", "info", "{runs}/text.lcm"),
        ("text.lcm",),
    ),
    "replay of no log": (
        ("replay", "{runs}/text.lcm"),
        ("text.lcm", "not an LCM event log"),
    ),
    "replay of an empty log": (
        ("replay", "{runs}/empty.lcm"),
        ("empty.lcm", "empty"),
    ),
    "rerun of an empty log": (
        ("rerun", "{runs}/empty.lcm", "--node", "sampler"),
        ("empty.lcm", "empty"),
    ),
    "rerun of a damaged log": (
        ("rerun", "{runs}/zeros.lcm", "--node", "sampler"),
        ("zeros.lcm", "byte", "--salvage"),
    ),
    "unknown channel": (
        ("log", "info", "{runs}/good", "--channel", "R1_MOCAP"),
        ("R1_MOCAP", "R1_MOCAP_POSE"),
    ),
    "impossible radio": (
        ("calibrate", "--lockstep", "--set", "simulation.radio.to_robot.loss=1.5"),
        ("simulation.radio.to_robot.loss", "less than or equal to 1", "1.5"),
    ),
    "model of the other robot": (
        ("park", "--model", "{runs}/model.npz", "--robot", "dynamic", "--lockstep"),
        ("kinematic robot", "--robot kinematic"),
    ),
    "damaged model": (
        ("park", "--model", "{runs}/broken.npz", "--lockstep"),
        ("broken.npz", "klab train"),
    ),
    "missing model": (
        ("park", "--model", "{runs}/none.npz", "--lockstep"),
        ("none.npz", "klab train"),
    ),
    "too few samples": (
        ("train", "{runs}/short", "--out", "{out}"),
        ("span only", "of the 5 observables", "--segments"),
    ),
    "dictionary of the other robot": (
        ("train", "{runs}/good", "--dictionary", "D8Eul", "--out", "{out}"),
        ("'D8Eul'", "D5t"),
    ),
    "folder in use": (
        ("calibrate", "--lockstep", "--out", "{runs}/good"),
        ("runs", "--out"),
    ),
    "missing data set": (
        ("train", "{runs}/none.npz"),
        ("none.npz", "no such data set", "klab dataset make"),
    ),
    "a model is no data set": (
        ("dataset", "info", "{runs}/model.npz"),
        ("model.npz", "not a data set", "klab dataset make"),
    ),
    "another window of a set that is made": (
        ("train", "{runs}/data.npz", "--window", "10", "--out", "{out}"),
        ("data.npz", "--window 40, not 10", "session"),
    ),
    "a data set that would not be found again": (
        ("dataset", "make", "{runs}/good", "--out", "{out}"),
        ("out", "end in .npz", "--out"),
    ),
    "an incomplete folder": (
        ("dataset", "import", "{runs}/theirs", "--robot", "kinematic", "--dt", "0.05"),
        ("theirs", "lacks Y_2.dat"),
    ),
    "a folder that says nothing": (
        ("train", "{runs}/theirs", "--out", "{out}"),
        ("theirs", "--robot", "--dt"),
    ),
    "a folder of the other robot": (
        ("dataset", "import", "{runs}/dat", "--robot", "dynamic"),
        ("dat", "--robot kinematic, not dynamic"),
    ),
    "a folder in use": (
        ("dataset", "export", "{runs}/data.npz", "--out", "{runs}/dat"),
        ("dat: is not empty", "--out"),
    ),
    "no window changes the kinematic fit": (
        ("dataset", "sweep", "{runs}/good", "--out", "{out}"),
        ("session.lcm", "kinematic", "--robot dynamic"),
    ),
    "windows that are none": (
        ("dataset", "sweep", "{runs}/good", "--windows", "10;40"),
        ("--windows 10;40", "--windows 1,10,40"),
    ),
    "a window wider than every segment": (
        ("figure", "samples", "{runs}/good", "--windows", "10,90000", "--out", "{out}"),
        ("basis input 1", "90000", "--windows"),
    ),
    "fault without a simulated robot": (
        ("fault", "occlusion", "--robot-name", "R9"),
        ("R9_PLANT_TRUTH is silent", "klab up"),
    ),
    "fault that there is none of": (
        ("fault", "motor_revers"),
        ("unknown fault 'motor_revers', known: occlusion,", "did you mean motor-reversed?"),
    ),
    "fault with another's detail": (
        ("fault", "occlusion", "--wheel", "left"),
        ("occlusion has no wheel",),
    ),
    "impossible planned fault": (
        (
            "calibrate",
            "--lockstep",
            "--set",
            "simulation.faults=[{{kind: burst_loss, at_s: 1, loss: 2}}]",
        ),
        ("faults.0.loss", "less than or equal to 1", "found 2"),
    ),
    "a bus that is none": (
        ("calibrate", "--url", "nonsense://", "--out", "{out}"),
        ("nonsense://", "expected udpm://"),
    ),
}
OF_THE_LAB = ("goal that nobody drives to", "fault without a simulated robot")
"""Cases in which nothing is wrong with what was typed."""


@pytest.mark.parametrize("case", CASES)
def test_one_clear_message(case, runs, tmp_path):
    arguments, said = CASES[case]
    out = tmp_path / "out"
    done = klab(*(a.format(runs=runs, out=out) for a in arguments), cwd=tmp_path)
    code = ExitCode.LAB_FAILURE if case in OF_THE_LAB else ExitCode.MISUSE
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    for words in said:
        assert words in done.stderr
    assert done.stderr.count("klab: ") == 1
    assert list(tmp_path.iterdir()) == []


def test_doctor_says_how_to_mend_a_bus_that_is_none():
    done = klab(
        "doctor", "--bus-only", env=environment(LCM_DEFAULT_URL="udpm://nowhere.invalid:7667")
    )
    assert done.returncode == ExitCode.NO
    assert "multicast: MISSING" in done.stdout
    assert "'nowhere.invalid' is no address of a multicast group" in done.stdout


def test_a_salvaged_log_trains(runs, tmp_path):
    klab_ok("train", runs / "cut.lcm", "--salvage", "--out", tmp_path / "m.npz")


def test_log_info_says_how_many_bytes_and_seconds_were_passed_over(runs):
    facts = klab_json("log", "info", runs / "zeros.lcm", "--salvage")
    assert 300 <= facts["skipped_bytes"] < 1500
    assert 0.0 < facts["skipped_s"] < 0.1
    (damage,) = facts["damage"]
    assert damage["size"] == facts["skipped_bytes"]
    done = klab("log", "info", runs / "zeros.lcm", "--salvage")
    assert f"damaged, passed over: {damage['size']} bytes at byte {damage['offset']}" in done.stderr
    assert f"in 1 places, {facts['skipped_s']:.3f} s" in done.stderr


def test_doctor_is_content_here():
    said = klab_ok("doctor")
    assert "MISSING" not in said
    assert "datagram filter: ok" in said


def test_doctor_says_where_no_filter_keeps_hostile_datagrams_off(bus_url):
    said = klab_ok("doctor", "--url", bus_url.replace("udpm", "mpudpm"))
    assert "datagram filter: NONE" in said
    assert "keep strangers off" in " ".join(said.split())


@pytest.mark.parametrize(
    "command",
    [
        "demo",
        "up",
        "status",
        "down",
        "view",
        "topics",
        "calibrate",
        "train",
        "park",
        "replay",
        "rerun",
        "estop",
        "fault",
        "doctor",
    ]
    + ["log info", "log plot", "log export", "figure samples"]
    + [f"bench {what}" for what in ("lockstep", "motor", "faults", "dataset", "realtime", "logger")]
    + ["bench view", "bench stop", "bench flood"]
    + [f"dataset {what}" for what in ("make", "info", "export", "import", "sweep")]
    + [f"run {node}" for node in ("plant", "onboard", "logger", "sampler", "controller")],
)
def test_help_shows_a_worked_example(command):
    printed = " ".join(klab_ok(*command.split(), "--help").split())
    assert f"Example: klab {command}" in printed
