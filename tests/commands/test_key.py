"""`klab key new`, and what `klab doctor` and every command say of the key."""

import stat

import pytest
from klab import klab

from koopman_lab.bus.lab_key import fingerprint, read_key
from offboard.terminal.exit_codes import ExitCode


def test_a_key_is_made_where_it_is_asked_for_and_once(tmp_path):
    done = klab("key", "new", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    file = tmp_path / "lab.key"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert fingerprint(read_key(file)) in done.stderr.replace("\n", "")
    assert "bus.key_file=" in done.stderr
    before = file.read_bytes()
    done = klab("key", "new", file)
    assert done.returncode == 2
    assert "never overwritten" in done.stderr
    assert file.read_bytes() == before
    assert klab("key", "new", tmp_path / "other.key").returncode == 0


def test_doctor_says_whether_there_is_a_key_and_which(tmp_path):
    said = klab("doctor").stdout
    assert "lab's key: missing, not needed (none)" in said
    assert "whoever can reach this bus can drive the robot" in said
    file = tmp_path / "lab.key"
    assert klab("key", "new", file).returncode == 0
    said = klab("doctor", "--set", f"bus.key_file={file}").stdout
    assert f"lab's key: ok ({fingerprint(read_key(file))}" in said
    file.chmod(0o644)
    done = klab("doctor", "--set", f"bus.key_file={file}")
    assert done.returncode == ExitCode.NO
    assert "lab's key: BROKEN" in done.stdout


@pytest.mark.parametrize(
    "command",
    [
        ("run", "onboard"),
        ("run", "plant"),
        ("goal", "0", "0", "0"),
        ("estop", "--release"),
        ("topics", "--once"),
        ("status",),
        ("down",),
        ("fault", "occlusion"),
        ("up",),
    ],
    ids=" ".join,
)
def test_who_cannot_use_the_key_begins_nothing(tmp_path, command):
    """In one line: a program that went on without it would be believed by nobody."""
    file = tmp_path / "lab.key"
    file.write_bytes(b"short")
    file.chmod(0o600)
    done = klab(*command, "--set", f"bus.key_file={file}", cwd=tmp_path)
    assert done.returncode == 2
    assert "holds 5 bytes, and a key has 32" in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["lab.key"]
