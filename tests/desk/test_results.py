"""What sessions bring: documented field by field, and the same after writing and reading."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from koopman_lab.geometry.planar import Pose
from koopman_lab.robots.dynamic import DYNAMIC
from koopman_lab.studies.closed_loop import columns
from offboard.desk import results
from offboard.desk.results import ParkOutcome, Pause, Result

numbers = st.floats(allow_nan=False)
counts = st.integers(0, 10**6)
poses = st.builds(Pose, numbers, numbers, numbers)
rows = st.tuples(*[numbers] * len(columns(DYNAMIC)))
outcomes = st.builds(
    ParkOutcome,
    final_pose=st.none() | poses,
    goal=poses,
    marker_offset=poses,
    duration_s=numbers,
    pauses=st.lists(st.builds(Pause, duration_s=numbers), max_size=2).map(tuple),
    solve_ms=st.lists(numbers, max_size=3).map(tuple),
    pose_age_ms=st.lists(numbers, max_size=3).map(tuple),
    steps=counts,
    missed_deadlines=counts,
    trajectory=st.lists(rows, max_size=3).map(tuple),
)


def kinds(base=Result):
    for kind in base.__subclasses__():
        yield kind
        yield from kinds(kind)


@pytest.mark.parametrize("kind", sorted(set(kinds()), key=lambda kind: kind.__name__))
def test_every_field_says_what_it_is_and_quantities_their_unit(kind):
    assert kind.__doc__.strip()
    for name, field in kind.model_fields.items():
        assert field.description, f"{kind.__name__}.{name} has no docstring"
        for suffix, unit in (("_s", "(s)"), ("_ms", "(ms)"), ("_pose", "(m, m, rad)")):
            if name.endswith(suffix):
                assert unit in field.description, f"{kind.__name__}.{name}: {unit}"


@given(outcomes)
def test_an_outcome_is_the_same_to_the_last_bit_after_writing_and_reading(outcome):
    text = json.dumps(outcome.model_dump())
    assert ParkOutcome.model_validate_json(text) == outcome


@given(outcomes, st.sampled_from(sorted(ParkOutcome.model_fields)))
def test_an_outcome_that_is_not_whole_is_refused(outcome, name):
    facts = outcome.model_dump()
    del facts[name]
    with pytest.raises(ValidationError, match=name):
        ParkOutcome.model_validate(facts)
    with pytest.raises(ValidationError, match="another"):
        ParkOutcome.model_validate(outcome.model_dump() | {"another": 1})


def test_results_do_not_change():
    pause = Pause(reason="tracking lost", duration_s=1.0)
    with pytest.raises(ValidationError, match="frozen"):
        pause.duration_s = 2.0


def test_summaries_begin_with_what_they_are_of():
    for kind in kinds(results.Summary):
        assert next(iter(kind.model_fields)) == "what"
