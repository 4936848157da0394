"""Sixty ways to use `klab` wrongly: no traceback, the exit code that says what it was, a next step.

Next to these stand `test_mistakes.py`, of files and sessions, and `test_interruptions.py`.
"""

import socket

import pytest
from ideal_data import ideal_dataset
from klab import MODEL, REFERENCE, environment, klab, klab_here

from offboard.terminal.exit_codes import ExitCode

LOG = str(REFERENCE / "calibration.lcm")
MODEL = str(MODEL)
HELP = "Try 'klab {} -h' for help."
GROUP = "224.0.0.0 to 239.255.255.255"
LOCKSTEP = ("calibrate", "--lockstep")
TRAIN = ("train", LOG, "--out", "{here}/new.npz")
PARK = ("park", "--lockstep", "--model", MODEL)
MISUSES = {
    # Types, and how many.
    "words for numbers": (("goal", "here", "0", "0"), ("no number", HELP.format("goal"))),
    "too few numbers": (("goal", "1", "2"), ("takes 3 values", HELP.format("goal"))),
    "too many numbers": (("goal", "1", "2", "3", "4"), ("(4)", HELP.format("goal"))),
    "half a pose": ((*PARK, "--goal", "1", "2"), ("'--goal' requires 3", HELP.format("park"))),
    "half a segment": ((*LOCKSTEP, "--segments", "2.5"), ("no whole number", "calibrate -h")),
    "a word for a count": ((*LOCKSTEP, "--segments", "many"), ("no whole number", "calibrate -h")),
    "a list for a number": (
        (*LOCKSTEP, "--set", "controller.horizon=[1]"),
        ("controller.horizon: input should be a valid integer", "found [1]"),
    ),
    "a decimal comma": (
        (*LOCKSTEP, "--set", "robot.wheel_radius_m=0,03"), ("robot.wheel_radius_m", "'0,03'")
    ),
    "no value at all": ((*LOCKSTEP, "--set"), ("'--set' requires an argument", "calibrate -h")),
    "no model": (("park", "--lockstep"), ("Missing option '--model'", HELP.format("park"))),
    # Signs and ranges.
    "no segments": ((*LOCKSTEP, "--segments", "0"), ("expected at least 1", "calibrate -h")),
    "a negative count": ((*LOCKSTEP, "--segments", "-3"), ("expected at least 1", "calibrate -h")),
    "a negative seed": ((*LOCKSTEP, "--seed", "-1"), ("expected at least 0", "calibrate -h")),
    "a negative window": ((*TRAIN, "--window", "-1"), ("expected at least 1", "train -h")),
    "a negative ridge": ((*TRAIN, "--ridge", "-1"), ("expected at least 0", "train -h")),
    "a ridge without end": ((*TRAIN, "--ridge", "inf"), ("inf is no number", "train -h")),
    "a ridge that is no number": ((*TRAIN, "--ridge", "nan"), ("--ridge", "train -h")),
    "no sampling time": ((*TRAIN, "--dt", "0"), ("dt", "0")),
    "a negative sampling time": ((*TRAIN, "--dt", "-0.05"), ("dt", "-0.05")),
    "no speed": (("replay", LOG, "--speed", "0"), ("--speed 0: must be above 0", "example 4")),
    "a backward speed": (("replay", LOG, "--speed", "-1"), ("--speed -1", "for example 4")),
    "no time to listen": (("topics", "--seconds", "-1"), ("expected at least 0.1", "topics -h")),
    "no such port": (("view", "--port", "99999"), ("expected at most 65535", "view -h")),
    "a negative bound": (
        (*LOCKSTEP, "--set", "controller.u_max=[-0.4, 1.5]"), ("controller.u_max", "-0.4")
    ),
    # Units.
    "a goal in cm": ((*PARK, "--goal", "50", "20", "90"), ("x1 = 50 m is outside", "floor.x1_m")),
    "a goal without end": ((*PARK, "--goal", "inf", "0", "0"), ("inf is no number", "park -h")),
    "a goal that is none": ((*PARK, "--goal", "0", "nan", "0"), ("nan is no number", "park -h")),
    "ms for s": (
        (*LOCKSTEP, "--set", "motor_loop.watchdog_s=150"),
        ("motor_loop.watchdog_s: 150 is more than 0.5 s",),
    ),
    "mm for m": (
        (*LOCKSTEP, "--set", "robot.wheel_radius_m=30"), ("30 is more than 0.5 m", "its unit")
    ),
    "degrees for rad": (
        (*LOCKSTEP, "--set", "controller.parked_angle_rad=90"), ("90 is more than", "its unit")
    ),
    # Names.
    "a command misspelt": (("calibrat",), ("Did you mean 'calibrate'", "Try 'klab -h'")),
    "a command of a group misspelt": (("log", "inof"), ("Did you mean 'info'", "klab log -h")),
    "an option misspelt": (("calibrate", "--segment", "3"), ("--segments", "calibrate -h")),
    "an option of another": (("goal", "0", "0", "0", "--seed", "1"), ("--seed", "goal -h")),
    "a robot misspelt": (
        (*LOCKSTEP, "--robot", "kinematc"), ("'kinematc'", "did you mean kinematic?")
    ),
    "a robot's name in small letters": (
        (*LOCKSTEP, "--robot-name", "r2"), ("robot.name", "pattern")
    ),
    "a preset misspelt": ((*LOCKSTEP, "--preset", "harhs"), ("'harsh'", "calibrate -h")),
    "a cost misspelt": ((*PARK, "--cost", "mee"), ("unknown cost 'mee', known: me, ce, ds",)),
    "a section misspelt": (
        (*LOCKSTEP, "--set", "controler.horizon=4"), ("did you mean controller",)
    ),
    "a key without section": (
        (*LOCKSTEP, "--set", "horizon=4"), ("did you mean controller.horizon?",)
    ),
    "a key without value": (
        (*LOCKSTEP, "--set", "controller.horizon"), ("expected section.key=value",)
    ),
    "a fault misspelt": (("fault", "motor-revers"), ("did you mean motor-reversed?",)),
    "a process misspelt": (("run", "plnt"), ("Did you mean 'plant'", "klab run -h")),
    "a dictionary that is none": ((*TRAIN, "--dictionary", "D9x"), ("'D9x'", "D5t")),
    "a predictor that is none": ((*TRAIN, "--predictor", "deep"), ("'deep'", "edmd")),
    "a key that is none": (("config", "keys", "--only", "horizont"), ("klab config keys",)),
    "a channel that is none": (
        ("log", "info", LOG, "--channel", "R1_MOCAP"), ("there are: ", "R1_MOCAP_POSE")
    ),
    # Files and folders.
    "no such session": (("train", "{here}/none"), ("no such",)),
    "a folder without a session": (("train", "{here}"), ("session.lcm",)),
    "a model for a log": (("log", "info", MODEL), ("not an LCM event log",)),
    "a log for a model": (("park", "--lockstep", "--model", LOG), ("klab train",)),
    "a model that is there": (
        ("train", "{here}/data.npz"), ("model.npz: is there already", "--out", "--overwrite")
    ),
    "a run that is there": (
        (*LOCKSTEP, "--out", "{here}/run"), ("holds a run already", "--out")
    ),
    "a key file that is there": (("key", "new", "{here}/lab.key"), ("never overwritten",)),
    "no such configuration": (("config", "check", "{here}/none.yaml"), ("no such",)),
    "a configuration that is none": (("config", "check", MODEL), ("not UTF-8", "as UTF-8")),
    "a data set that would not be found": (
        ("dataset", "make", LOG, "--out", "{here}/data"), ("end in .npz", "--out")
    ),
    # URLs.
    "no URL": (("status", "--url", "garbage"), ("is no URL", "udpm://239.255.76.67:7667")),
    "an address of one machine": (("status", "--url", "udpm://10.0.0.1:7667"), (GROUP, "ttl=1")),
    "a name for a group": (("status", "--url", "udpm://lab.local:7667"), (GROUP,)),
    "another scheme": (("status", "--url", "http://239.255.76.67:7667"), ("expected udpm://",)),
    "half a scheme": (("status", "--url", "udp://239.255.76.67:7667"), ("expected udpm://",)),
    "a bus within one process": (("status", "--url", "memq://"), ("no other program", "udpm://")),
    "a log for a bus": (("status", "--url", "file://x.lcm"), ("klab replay FILE",)),
    "no port": (("status", "--url", "udpm://239.255.76.67"), ("port is missing", ":7667")),
    "a port that is none": (
        ("status", "--url", "udpm://239.255.76.67:99999"), ("from 1 to 65535",)
    ),
    "a ttl that is none": (
        ("status", "--url", "udpm://239.255.76.67:7667?ttl=abc"), ("from 0 to 255",)
    ),
    "a ttl misspelt": (
        ("status", "--url", "udpm://239.255.76.67:7667?tll=1"), ("'tll'", "ttl")
    ),
    "guests on the lab's bus": (
        ("relay", "--read-only", "--to", "udpm://239.255.76.69:7667", "--url",
         "udpm://239.255.76.67:7667?ttl=0"),
        ("take another port",),
    ),
}  # fmt: skip
"""What is typed, and what is said: what is wrong, and the next step."""


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """Make a folder with a data set, a model beside it, a run, and a key."""
    folder = tmp_path_factory.mktemp("here")
    ideal_dataset("kinematic").save(folder / "data.npz")
    (folder / "model.npz").write_bytes(b"of somebody")
    (folder / "run").mkdir()
    (folder / "run" / "summary.json").write_text("{}")
    (folder / "lab.key").write_bytes(bytes(32))
    return folder


def files_of(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_there_are_sixty_of_them():
    assert len(MISUSES) >= 60


@pytest.mark.parametrize("what", MISUSES)
def test_a_misuse_is_refused_in_words_with_a_next_step(what, here, tmp_path):
    arguments, said = MISUSES[what]
    before = files_of(here)
    done = klab_here(*(a.format(here=here) for a in arguments), cwd=tmp_path)
    text = " ".join(done.stderr.split())
    assert done.returncode == ExitCode.MISUSE, text
    assert done.stdout == ""
    assert "Traceback" not in text
    assert text.count("klab: ") + text.count("Error: ") == 1
    for words in said:
        assert " ".join(words.split()) in text
    assert list(tmp_path.iterdir()) == []
    assert files_of(here) == before


def test_a_port_that_another_program_holds_is_named_with_a_free_one(tmp_path):
    """No command can listen there; each says so, and the doctor as well."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("0.0.0.0", 0))
        port = holder.getsockname()[1]
        url = f"udpm://239.255.76.67:{port}?ttl=0"
        for command in (("status",), ("topics", "--once"), ("goal", "-0.5", "-0.2", "30")):
            done = klab(*command, "--url", url, cwd=tmp_path)
            assert done.returncode == ExitCode.LAB_FAILURE
            assert f"holds port {port}; end it" in done.stderr
            assert f"another port, for example {port + 1}" in done.stderr
            assert "Traceback" not in done.stderr
        doctor = klab("doctor", "--bus-only", env=environment(LCM_DEFAULT_URL=url))
    assert doctor.returncode == ExitCode.NO
    assert "multicast: MISSING" in doctor.stdout
    assert f"another port, for example {port + 1}" in doctor.stdout
    assert "Traceback" not in doctor.stderr + doctor.stdout
