"""The file of the lab's key: made once, and refused where it may be no secret."""

import os
import stat

import pytest

from koopman_lab.bus.lab_key import (
    KEY_BYTES,
    configured_key,
    fingerprint,
    read_key,
    write_new_key,
)
from koopman_lab.config.load import load_config
from koopman_lab.errors import ConfigError, NotWrittenError


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "lab.key"
    write_new_key(path)
    return path


def test_a_new_key_is_random_and_only_its_owner_can_read_it(file, tmp_path):
    key = read_key(file)
    assert len(key) == KEY_BYTES
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert write_new_key(tmp_path / "other.key") == read_key(tmp_path / "other.key") != key
    assert {path.name for path in tmp_path.iterdir()} == {"lab.key", "other.key"}


def test_its_mode_does_not_depend_on_the_umask(tmp_path):
    before = os.umask(0)
    try:
        write_new_key(tmp_path / "lab.key")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "lab.key").stat().st_mode) == 0o600


def test_a_key_is_never_overwritten(file, tmp_path):
    key = read_key(file)
    with pytest.raises(ConfigError, match="never overwritten"):
        write_new_key(file)
    assert read_key(file) == key
    assert [path.name for path in tmp_path.iterdir()] == ["lab.key"]


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(NotWrittenError, match="cannot be written"):
        write_new_key(tmp_path / "nowhere" / "lab.key")


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620, 0o610, 0o660, 0o666, 0o777])
def test_a_key_that_others_may_read_or_write_is_refused(file, mode):
    file.chmod(mode)
    with pytest.raises(ConfigError, match=rf"{file}: mode {mode:o} "):
        read_key(file)


@pytest.mark.parametrize("size", [0, 1, KEY_BYTES - 1, KEY_BYTES + 1, 65])
def test_a_key_of_another_length_is_refused(file, size):
    file.write_bytes(bytes(size))
    with pytest.raises(ConfigError, match=f"holds {size} bytes, and a key has {KEY_BYTES}"):
        read_key(file)


def test_another_users_key_is_refused(file, monkeypatch):
    """Seen from another user: only root could give the file away."""
    other = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: other)
    with pytest.raises(ConfigError, match=f"belongs to user {other - 1}"):
        read_key(file)


def test_what_is_no_file_is_refused_and_waited_for_by_nobody(tmp_path):
    os.mkfifo(tmp_path / "pipe", 0o600)
    for path, words in ((tmp_path / "pipe", "is no file"), (tmp_path, "is no file")):
        with pytest.raises(ConfigError, match=words):
            read_key(path)
    with pytest.raises(ConfigError, match=r"nothing\.key: cannot be read .*`klab key new"):
        read_key(tmp_path / "nothing.key")


def test_without_a_file_named_there_is_no_key(file, monkeypatch):
    assert load_config().bus.key_file is None
    assert configured_key(load_config()) is None
    named = load_config(overrides=[f"bus.key_file={file}"])
    assert configured_key(named) == read_key(file)
    monkeypatch.setenv("HOME", str(file.parent))
    assert configured_key(load_config(overrides=["bus.key_file=~/lab.key"])) == read_key(file)


def test_a_fingerprint_tells_keys_apart(file, tmp_path):
    other = write_new_key(tmp_path / "other.key")
    assert fingerprint(read_key(file)) == fingerprint(read_key(file)) != fingerprint(other)
