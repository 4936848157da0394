"""Each line of the README does its job on what the lines before it left.

A line that is neither run here, nor typed in one of TYPED_IN, nor named in ELSEWHERE fails the
test, so nobody can add one that is not thought of.
"""

import re
from pathlib import Path

import pytest
from readme import LINES, README, REPLAYS, blocks
from readme_run import SHORTER, begins, is_alone

TYPED_IN = ("test_first_hour.py", "test_readme_live.py")
"""Where lines are typed that wait for a lab, a bus or Ctrl-C."""
ELSEWHERE = {
    "on less, and what it prints looked at: tests/bench: test_bench, test_fault_table, test_soak": (
        *("klab bench faults", "klab bench realtime", "klab bench ocp", "klab bench parks"),
        *("klab bench logger", "klab bench edmd", "klab bench view", "klab bench soak"),
        *("klab bench flood", "klab bench estop"),
    ),
    "in a browser: tests/browser/test_bench_stop.py": ("klab bench stop",),
    "by a shell: tests/packaging/test_first_hour.py": ("source .venv/bin/activate", "klab doctor"),
    "the bus is the test's": ("export LCM_DEFAULT_URL",),
    "would run this test within itself": ("./scripts/test", "./scripts/check"),
    "on less: tests/packaging/test_mutate.py": ("./scripts/mutate",),
    "on less: tests/packaging/test_fuzz_script.py": ("./scripts/fuzz",),
    "needs Java and a screen: tests/packaging/test_spy.py": ("./scripts/spy",),
}
"""The beginnings of lines that are only parsed, by test_readme, under the reason."""


def sources() -> str:
    """Return the files of TYPED_IN; a long line stands there in several pieces."""
    here = Path(__file__).parent
    return re.sub(r'"\n\s*"', "", "".join((here / name).read_text() for name in TYPED_IN))


def is_typed_elsewhere(words: list[str], text: str) -> bool:
    """Return whether a text types this line, neither more nor less of it."""
    line = " ".join(words).replace(REPLAYS, '"{REPLAYS}"')
    return re.search(rf"""(["']){re.escape(line)}\1""", text) is not None


TEXT = sources()
HERE = [
    number
    for number, words in enumerate(LINES)
    if is_alone(words) and not is_typed_elsewhere(words, TEXT)
]


@pytest.mark.parametrize("number", HERE, ids=[" ".join(LINES[number]) for number in HERE])
def test_it_does_its_job_on_what_the_lines_before_it_left(readme, number):
    readme.line(number)


def test_each_line_is_run():
    known = [beginning for beginnings in ELSEWHERE.values() for beginning in beginnings]
    for number, words in enumerate(LINES):
        line = " ".join(words)
        run = number in HERE or begins(line, known) or is_typed_elsewhere(words, TEXT)
        assert run, f"README: nothing runs `{line}`: run it in {TYPED_IN}, or say in ELSEWHERE why"


def test_there_are_no_blocks_but_of_lines():
    """One in another language would be run by nothing."""
    assert {language for language, _ in blocks(README)} <= {"", "bash"}


@pytest.mark.parametrize("table", [SHORTER, *([b] for bs in ELSEWHERE.values() for b in bs)])
def test_no_table_names_what_is_not_there(table):
    for beginning in table:
        assert any(begins(" ".join(words), [beginning]) for words in LINES), beginning


def test_an_exported_log_is_a_file_for_each_channel(readme):
    folder = readme.with_typed("klab log export runs/park --format csv")
    assert (folder / "runs" / "park" / "session-csv" / "R1_MPC_STATE.csv").exists()


def test_results_go_into_the_readme(readme):
    folder = readme.with_typed("./scripts/show-results runs/reproduction")
    shown = (folder / "README.md").read_text()
    assert "44 not measured" in shown.partition("<!-- results -->")[2]
