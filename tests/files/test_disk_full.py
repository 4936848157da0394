"""A disk that takes no more is said in one line by whatever writes, and leaves nothing half."""

import os
import resource
import signal
import subprocess
from pathlib import Path

import pytest
from ideal_data import ideal_dataset
from klab import KLAB, environment, klab

from koopman_lab.errors import DiskError, LabError
from koopman_lab.files import replacing, replacing_folder, write_json
from offboard.terminal.exit_codes import ExitCode

DATA = Path(__file__).parents[1] / "data" / "reference"
LOG, MODEL, PARK = (str(DATA / name) for name in ("calibration.lcm", "model.npz", "park.lcm"))
ONE = ("--windows", "1")


def limited(size):
    """Return what lets a process write files of so many bytes only, as a full disk does."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as a disk, which sends no signal
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


COMMANDS = {
    "run folder": (100, ("calibrate", "--lockstep", "--out", "{out}/run")),
    "session log": (
        60_000, ("calibrate", "--lockstep", "--segments", "1", "--out", "{out}/run"),
    ),
    "log of a park": (60_000, ("park", "--model", MODEL, "--lockstep", "--out", "{out}/park")),
    "data set": (1000, ("dataset", "make", LOG, "--out", "{out}/data.npz")),
    "folder of numbers": (1000, ("dataset", "export", LOG, "--out", "{out}/numbers")),
    "model": (1000, ("train", "{data}", "--out", "{out}/model.npz")),
    "numbers of a simulation": (
        5000, ("simulate", "--model", MODEL, "--duration", "1", "--out", "{out}/sim"),
    ),
    "figure of a log": (1000, ("log", "plot", PARK, "--out", "{out}/figure")),
    "figure of samples": (1000, ("figure", "samples", LOG, *ONE, "--out", "{out}/samples")),
    "logs as CSV": (1000, ("log", "export", PARK, "--out", "{out}/csv")),
    "logs as MCAP": (1000, ("log", "export", PARK, "--format", "mcap", "--out", "{out}/x.mcap")),
    "logs as a bag": (1000, ("log", "export", PARK, "--format", "ros2", "--out", "{out}/bag")),
    "logs for MATLAB": (1000, ("log", "export", PARK, "--format", "mat", "--out", "{out}/x.mat")),
    "logs as Parquet": (1000, ("log", "export", PARK, "--format", "parquet", "--out", "{out}/p")),
}  # fmt: skip


@pytest.mark.parametrize("what", COMMANDS)
def test_every_writer_says_in_one_line_that_the_disk_is_full(what, tmp_path):
    size, arguments = COMMANDS[what]
    data = tmp_path / "given" / "data.npz"
    ideal_dataset("kinematic").save(data)
    # Python itself leaves half of what it compiles.
    done = klab(
        *(a.format(out=tmp_path, data=data) for a in arguments),
        preexec_fn=limited(size),
        env=environment(PYTHONDONTWRITEBYTECODE="1"),
    )
    said = " ".join(done.stderr.split())
    assert (done.returncode, "Traceback" in said) == (ExitCode.LAB_FAILURE, False), said
    assert said.count("klab: ") == 1
    assert "cannot be written" in said
    assert "File too large" in said
    # Hidden is what a writer had not finished.
    assert not [file for file in tmp_path.rglob(".*") if file.is_file()]


def test_output_that_nobody_takes_is_said():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*KLAB, "log", "info", PARK],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == ExitCode.LAB_FAILURE
    assert "No space left on device" in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("writer", [replacing, replacing_folder])
def test_what_cannot_be_written_is_an_expected_mistake_that_names_the_file(writer, tmp_path):
    (tmp_path / "file").write_text("")
    refused = pytest.raises(DiskError, match=r"file/x: cannot be written \(.*\)")
    with refused as caught, writer(tmp_path / "file" / "x"):
        pytest.fail("nothing to write to")
    assert isinstance(caught.value, LabError)
    assert isinstance(caught.value, OSError)
    assert caught.value.errno


def test_a_file_that_is_there_stays_when_the_new_one_does_not_fit(tmp_path):
    path = tmp_path / "facts.json"
    write_json(path, {"kept": True})
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        limited(100)()
        try:
            write_json(path, {"x": "y" * 1000})
        except DiskError as error:
            os.write(writer, str(error).encode())
        os._exit(0)
    os.waitpid(child, 0)
    os.close(writer)
    assert b"File too large" in os.read(reader, 1000)
    os.close(reader)
    assert path.read_text().startswith('{\n  "kept"')
    assert list(tmp_path.iterdir()) == [path]
