"""What the page can start: what is sent is held against what was offered, nothing else gets on."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopman_lab.errors import LabStateError
from offboard.cli.main import command_line
from offboard.viewer.tasks import TASKS, Choice

OFFERS = {
    "robots": [Choice("R1", "R1")],
    "kinds": [Choice("kinematic", "kinematic")],
    "presets": [Choice("lab", "lab"), Choice("harsh", "harsh")],
    "costs": [Choice("me", "me")],
    "shapes": [Choice("square", "square")],
    "dictionaries": [Choice("D5t", "D5t")],
    "models": [Choice("/runs/a/model.npz", "a")],
    "sessions": [Choice("/runs/s", "s")],
    "logs": [Choice("/runs/s", "s")],
}
PARK = {"robot": "R1", "model": "/runs/a/model.npz", "cost": "me", "goal": [-0.5, 1e-7, 30]}
NUMBERS = st.one_of(st.integers(-2, 2000), st.floats(-1e3, 1e3))
OFFERED = st.sampled_from(sorted({c.value for choices in OFFERS.values() for c in choices}))
VALUES = st.one_of(OFFERED, st.text(max_size=4), NUMBERS, st.lists(NUMBERS, max_size=4))


def test_a_park_becomes_the_command_that_a_person_would_type():
    assert TASKS["park"].arguments(PARK, OFFERS) == [
        *("park", "--robot-name", "R1", "--model", "/runs/a/model.npz", "--cost", "me"),
        *("--goal", "-0.5", "1e-07", "30.0"),
    ]


def test_what_is_left_out_is_left_to_the_command():
    values = {"robot": "R1", "kind": "kinematic"}
    assert TASKS["calibrate"].arguments(values, OFFERS) == [
        *("calibrate", "--robot-name", "R1", "--robot", "kinematic")
    ]


@pytest.mark.parametrize(
    ("task", "change", "why"),
    [
        ("park", {"model": "/etc/passwd"}, "not offered"),
        ("park", {"model": "--help"}, "not offered"),
        ("park", {"model": None}, "choose the model first"),
        ("park", {"robot": ["R1"]}, "not offered"),
        ("park", {"goal": [0.0, 0.0]}, "expected 3 numbers"),
        ("park", {"goal": [0.0, 0.0, "0"]}, "expected 3 numbers"),
        ("park", {"goal": [0.0, 0.0, True]}, "expected 3 numbers"),
        ("park", {"goal": [0.0, 0.0, 10**400]}, "expected 3 numbers"),
        ("park", {"seed": -1}, "a whole number from 0"),
        ("park", {"seed": 1.0}, "a whole number from 0"),
        ("park", {"lockstep": 1}, "takes no 'lockstep'"),
        ("park", {"--out": "/tmp"}, "takes no '--out'"),
    ],
)
def test_what_no_form_offers_is_refused_in_words(task, change, why):
    with pytest.raises(LabStateError, match=why):
        TASKS[task].arguments(PARK | change, OFFERS)


@given(
    st.sampled_from(sorted(TASKS)),
    st.dictionaries(
        st.sampled_from(sorted({f.name for t in TASKS.values() for f in t.fields} | {"x"})), VALUES
    ),
)
def test_no_word_of_a_command_comes_from_the_page_itself(task, values):
    """Whatever is sent: flags are ours, names were offered, and the rest are numbers."""
    ours = {c.value for choices in OFFERS.values() for c in choices}
    ours |= {task} | {field.flag for field in TASKS[task].fields}
    try:
        words = TASKS[task].arguments(values, OFFERS)
    except LabStateError:
        return
    for word in words:
        assert word in ours or float(word) == float(word)


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_every_flag_is_one_of_the_command(task):
    command = command_line().commands[task.name]
    options = {option for parameter in command.params for option in parameter.opts}
    assert {field.flag for field in task.fields if field.flag} <= options
