"""What is known of a lab that broke, after everybody who could say it is gone."""

import os

import pytest

from koopman_lab.config.load import load_config
from offboard.lab.process_notes import ProcessNote, broken_labs, with_broken_labs
from offboard.lab.run_folder import RunFolder
from offboard.monitor.process_states import ALIVE, DIED

NOW_US = 1_800_000_000_000_000


@pytest.fixture
def lab(bus_url, tmp_path, monkeypatch):
    """ProcessNote a lab whose command is this process, which is no `klab`: to others it is gone."""
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "cache"))
    config = load_config(overrides=[f"bus.url={bus_url}"])
    folder = RunFolder(tmp_path / "run")
    note = ProcessNote(config, folder)
    folder.process_log("plant").parent.mkdir(parents=True)
    for pid, name in enumerate(("logger", "plant", "onboard"), start=100):
        note.started(name, pid)
        folder.process_log(name).write_text("first\nno room for the wheels\n")
        os.utime(folder.process_log(name), ns=(NOW_US * 1000, NOW_US * 1000))
    return config, folder, note


def test_a_command_that_ends_as_it_should_leaves_no_note(lab, bus_url):
    _, _, note = lab
    note.close()
    assert broken_labs(bus_url, NOW_US) == {}


def test_who_died_is_known_with_its_last_lines_when_all_others_have_ended(lab, bus_url):
    _, folder, note = lab
    note.died("plant", "signal SIGKILL", NOW_US - 7_000_000)
    note.close()
    (entry,) = broken_labs(bus_url, NOW_US)["R1"]
    assert (entry.name, entry.state, entry.pid, entry.age_s) == ("plant", DIED, 101, 7.0)
    assert entry.report.ended == "signal SIGKILL"
    assert entry.report.log_file == str(folder.process_log("plant").absolute())
    assert entry.report.last_lines == "first\nno room for the wheels"
    assert broken_labs("udpm://239.255.76.67:1?ttl=0", NOW_US) == {}
    assert broken_labs(bus_url, NOW_US + round(8 * 86_400e6))["R1"] == []


@pytest.mark.usefixtures("lab")
def test_of_a_command_that_was_killed_itself_all_processes_are_named(bus_url):
    found = broken_labs(bus_url, NOW_US)["R1"]
    assert {e.name: e.pid for e in found} == {"logger": 100, "plant": 101, "onboard": 102}
    assert all("which had started it" in entry.report.ended for entry in found)


def test_the_next_lab_of_the_robot_takes_the_place_of_what_broke(lab, bus_url):
    config, folder, note = lab
    note.died("plant", "exit code 1", NOW_US)
    other = config.model_copy(update={"robot": config.robot.model_copy(update={"name": "R2"})})
    ProcessNote(other, folder).started("plant", 200)
    assert set(broken_labs(bus_url, NOW_US)) == {"R1", "R2"}
    following = ProcessNote(config, folder)
    following.started("logger", 300)
    following.close()
    assert set(broken_labs(bus_url, NOW_US)) == {"R2"}


@pytest.mark.usefixtures("lab")
def test_who_speaks_again_is_not_called_dead(bus_url):
    lost = broken_labs(bus_url, NOW_US)
    (plant,) = [entry for entry in lost["R1"] if entry.name == "plant"]
    both = with_broken_labs({"R1": [plant._replace(state=ALIVE, pid=7, report=None)]}, lost)["R1"]
    states = {entry.name: (entry.state, entry.pid) for entry in both}
    assert states == {"plant": (ALIVE, 7), "logger": (DIED, 100), "onboard": (DIED, 102)}


@pytest.mark.usefixtures("lab")
def test_who_died_is_named_beside_another_of_its_name_that_a_command_started_before(bus_url):
    lost = broken_labs(bus_url, NOW_US)
    (logger,) = [entry for entry in lost["R1"] if entry.name == "logger"]
    both = with_broken_labs({"R1": [logger._replace(state=ALIVE, pid=7)]}, {"R1": [logger]})["R1"]
    assert [(e.pid, e.state) for e in both] == [(7, ALIVE), (100, DIED)]


def test_a_folder_that_cannot_be_written_costs_only_the_note(lab, bus_url, tmp_path, monkeypatch):
    config, folder, _ = lab
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("KOOPMAN_LAB_CACHE", str(tmp_path / "file"))
    note = ProcessNote(config, folder)
    note.started("logger", 1)
    note.close()
    assert broken_labs(bus_url, NOW_US) == {}
