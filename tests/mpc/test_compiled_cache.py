"""A library of the cache is what was built, by nobody else, or it is built again."""

import ctypes
import logging
import os
import shutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from koopman_lab.files import CACHE_VARIABLE
from koopman_lab.mpc import compiled

SOURCE = "int answer(void) { return 42; }\n"
OTHER = "int answer(void) { return 13; }\n"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a cache folder with two libraries that nothing was loaded from since."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(folder))
        return [compiled.library(source).name for source in (SOURCE, OTHER)], folder


@pytest.fixture
def place(whole, tmp_path, monkeypatch):
    """Return the library of SOURCE in a copy of the cache that this process never loaded from."""
    (name, _), folder = whole
    shutil.copytree(folder, tmp_path / "cache")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / compiled.FOLDER / name


def replaced(path, content):
    path.unlink()  # what is mapped into a process must not be changed under it
    path.write_bytes(content)
    path.chmod(0o700)


def linked(path):
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


DAMAGES = {
    "no library": lambda path, _: path.unlink(),
    "no note": lambda path, _: compiled.note_of(path).unlink(),
    "an empty note": lambda path, _: compiled.note_of(path).write_text(""),
    "an empty library": lambda path, _: replaced(path, b""),
    "half a library": lambda path, _: replaced(path, path.read_bytes()[: path.stat().st_size // 2]),
    "no library at all": lambda path, _: replaced(path, b"not a library"),
    "another library": lambda path, other: replaced(path, (path.parent / other).read_bytes()),
    "a link": lambda path, _: linked(path),
    "a library of a group": lambda path, _: path.chmod(0o770),
    "a library of everybody": lambda path, _: path.chmod(0o707),
    "a note of everybody": lambda path, _: compiled.note_of(path).chmod(0o606),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_not_just_what_was_built_is_built_again(damage, place, whole, caplog):
    DAMAGES[damage](place, whole[0][1])
    fault, there = compiled.fault_of(place), place.exists()
    assert fault is not None
    assert compiled.library(SOURCE) == place
    assert compiled.fault_of(place) is None
    assert ctypes.CDLL(str(place)).answer() == 42
    said = [(r.levelno, r.getMessage()) for r in caplog.records]
    assert said == ([(logging.WARNING, f"{place}: {fault}; it is built again")] if there else [])


@settings(
    deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_bit_of_a_library_can_change_unnoticed(data, place, whole):
    content = bytearray((whole[1] / compiled.FOLDER / place.name).read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    replaced(place, bytes(content))
    assert compiled.fault_of(place) == "it is not what was built"


def test_a_whole_library_is_taken_as_it_is(place, caplog):
    before = place.stat()
    assert compiled.library(SOURCE) == place
    assert (place.stat().st_ino, place.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert not caplog.records


def test_others_lose_the_right_to_write_into_the_folder(place):
    place.parent.chmod(0o777)
    assert compiled.library(SOURCE) == place
    assert place.parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.usefixtures("place")
def test_nothing_of_another_user_is_loaded(monkeypatch):
    other = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: other)
    with pytest.raises(compiled.NotCompiledError, match="another user's"):
        compiled.library(SOURCE)
