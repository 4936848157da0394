"""No file makes a reader stumble: a short run of every target of `scripts/fuzz`, and its corpus."""

import pytest
from fuzzing.targets import CORPUS, TARGETS, survive
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from koopman_lab.errors import LabError

EXAMPLES = 40


@pytest.mark.parametrize("name", TARGETS)
@settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(data=st.data())
def test_a_reader_takes_a_file_or_refuses_it_as_an_expected_mistake(name, data, tmp_path):
    target = TARGETS[name]
    seed = data.draw(st.sampled_from(target.seeds))
    survive(target, tmp_path, data.draw(target.changed(seed, target.seeds)))


@pytest.mark.parametrize("name", TARGETS)
def test_every_file_of_the_corpus_is_survived_and_the_reader_takes_one_at_least(name, tmp_path):
    target, taken = TARGETS[name], 0
    for content in target.seeds:
        try:
            target.read(tmp_path, content)
        except LabError:
            continue
        taken += 1
    assert taken


def test_no_corpus_is_forgotten():
    used = {target.corpus for target in TARGETS.values()} | {"columns-of-others"}
    assert {folder.name for folder in CORPUS.iterdir()} == used
