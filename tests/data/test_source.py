"""A session, a file and a folder are the same data."""

import dataclasses

import pytest
from synthetic_session import Session

from koopman_lab.data.dat import write_folder
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import PassedOver
from koopman_lab.data.source import open_source, window_of
from koopman_lab.errors import DataError, LogError


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Return a session, its data set as a file, and as a folder."""
    folder = tmp_path_factory.mktemp("places")
    (folder / "session").mkdir()
    log = Session("dynamic", segments=1).write(folder / "session" / "session.lcm")
    dataset = DataSet.from_log(log)
    dataset.save(folder / "data.npz")
    write_folder(dataset, folder / "dat")
    return folder


NAMES = ("session", "session/session.lcm", "data.npz", "dat")


@pytest.mark.parametrize("name", NAMES)
def test_the_same_data_wherever_they_come_from(places, name):
    found = open_source(places / name)
    assert found.dataset.data_hash == DataSet.load(places / "data.npz").data_hash
    assert found.dictionary == "D8Eul"
    assert window_of(found.dataset) == 40
    assert found.folder in (places, places / "session", places / "dat")
    assert found.passed_over in (None, PassedOver(places / "session" / "session.lcm", (), {}))


@pytest.mark.parametrize("name", NAMES)
def test_what_was_made_already_may_be_said_again(places, name):
    found = open_source(places / name, robot_kind="dynamic", dt_s=0.05, window=40)
    assert found.dataset.dt_s == 0.05


@pytest.mark.parametrize("name", ["data.npz", "dat"])
@pytest.mark.parametrize(
    ("other", "flag"),
    [({"window": 30}, "--window"), ({"dt_s": 0.1}, "--dt"), ({"robot_kind": "kinematic"}, "--rob")],
)
def test_what_was_made_already_cannot_be_made_otherwise(places, name, other, flag):
    with pytest.raises(DataError, match=f"{name}: .*{flag}.* leave out {flag}"):
        open_source(places / name, **other)


def test_only_a_session_can_be_processed_in_another_way(places):
    found = open_source(places / "session", window=30, dt_s=0.1).dataset
    assert (window_of(found), found.dt_s) == (30, 0.1)
    with pytest.raises(DataError, match="--robot dynamic, not kinematic"):
        open_source(places / "session", robot_kind="kinematic")


def test_a_folder_from_elsewhere_says_no_window(places, tmp_path):
    for index in range(3):
        for letter in "XY":
            name = f"{letter}_{index}.dat"
            (tmp_path / name).write_bytes((places / "dat" / name).read_bytes())
    with pytest.raises(DataError, match="--robot dynamic, and --dt"):
        open_source(tmp_path)
    found = open_source(tmp_path, robot_kind="dynamic", dt_s=0.05).dataset
    assert window_of(found) is None
    assert window_of(dataclasses.replace(found, metadata={"processing": 3})) is None
    with pytest.raises(DataError, match="--window unknown, not 40"):
        open_source(tmp_path, robot_kind="dynamic", dt_s=0.05, window=40)


def test_places_where_nothing_is(tmp_path):
    with pytest.raises(DataError, match=r"none\.npz: no such data set; `klab dataset make"):
        open_source(tmp_path / "none.npz")
    with pytest.raises(LogError, match="no such log"):
        open_source(tmp_path / "none")
