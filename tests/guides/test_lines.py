"""Each line of the guides does its job on what the lines before it left.

A line that is neither run here, nor typed in one of TYPED_IN, nor named in ELSEWHERE fails the
test, so nobody can add one that is not thought of.
"""

import re
from pathlib import Path

import pytest
from guide_pages.lines_run import SHORTER, begins, is_alone
from guide_pages.pages import LINES, PAGES, REPLAYS, TYPED, blocks

TESTS = Path(__file__).parents[1]
TYPED_IN = (
    *("guides/test_first_hour.py", "guides/test_lines_live.py"),
    "support/guide_pages/newcomer.py",
)
"""Where lines are typed that wait for a lab, a bus, a browser or Ctrl-C."""
ELSEWHERE = {
    "on less, and what it prints looked at: tests/bench: test_bench, test_fault_table, test_soak": (
        *("klab bench faults", "klab bench realtime", "klab bench ocp", "klab bench parks"),
        *("klab bench logger", "klab bench edmd", "klab bench view", "klab bench soak"),
        *("klab bench flood", "klab bench estop"),
    ),
    "in a browser: tests/browser/test_bench_stop.py": ("klab bench stop",),
    "by a shell: tests/guides/test_first_hour.py": ("source .venv/bin/activate", "klab doctor"),
    "the bus is the test's": ("export LCM_DEFAULT_URL",),
    "would run this test within itself": ("./scripts/test", "./scripts/check"),
    "on less: tests/packaging/test_mutate.py": ("./scripts/mutate",),
    "on less: tests/packaging/test_fuzz_script.py": ("./scripts/fuzz",),
    "needs Java and a screen: tests/packaging/test_spy.py": ("./scripts/spy",),
    "tests/guides/test_site.py": ("./scripts/docs",),
}
"""The beginnings of lines that are only parsed, by test_commands_exist, under the reason."""


def sources() -> str:
    """Return the files of TYPED_IN; a long line stands there in several pieces."""
    return re.sub(r'"\n\s*"', "", "".join((TESTS / name).read_text() for name in TYPED_IN))


def is_typed_elsewhere(words: list[str], text: str) -> bool:
    """Return whether a text types this line, neither more nor less of it."""
    line = " ".join(words).replace(REPLAYS, '"{REPLAYS}"')
    return re.search(rf"""(["']){re.escape(line)}\1""", text) is not None


def name_of(words: list[str]) -> str:
    return " ".join(words).splitlines()[0]


TEXT = sources()
HERE = [
    number
    for number, words in enumerate(LINES)
    if is_alone(words) and not is_typed_elsewhere(words, TEXT)
]


@pytest.mark.parametrize("number", HERE, ids=[name_of(LINES[number]) for number in HERE])
def test_it_does_its_job_on_what_the_lines_before_it_left(guides, number):
    guides.line(number)


def test_each_line_is_run():
    known = [beginning for beginnings in ELSEWHERE.values() for beginning in beginnings]
    for number, words in enumerate(LINES):
        line = name_of(words)
        run = number in HERE or begins(line, known) or is_typed_elsewhere(words, TEXT)
        assert run, f"nothing runs `{line}`: run it in {TYPED_IN}, or say in ELSEWHERE why"


def test_there_are_no_blocks_but_of_lines():
    """One in another language would be run by nothing."""
    assert {language for language, _ in blocks(TYPED)} <= {"", "bash", "python"}


@pytest.mark.parametrize("table", [SHORTER, *([b] for bs in ELSEWHERE.values() for b in bs)])
def test_no_table_names_what_is_not_there(table):
    for beginning in table:
        assert any(begins(" ".join(words), [beginning]) for words in LINES), beginning


def test_an_exported_log_is_a_file_for_each_channel(guides):
    folder = guides.with_typed("klab log export runs/park --format csv")
    assert (folder / "runs" / "park" / "session-csv" / "R1_MPC_STATE.csv").exists()


def test_results_go_into_their_page(guides):
    folder = guides.with_typed("./scripts/show-results runs/reproduction")
    shown = (folder / "scripts" / "results" / "README.md").read_text()
    assert "44 not measured" in shown.partition("<!-- results -->")[2]


def test_the_tables_of_messages_are_those_of_the_sources(guides):
    folder = guides.with_typed("./scripts/show-messages")
    page = "lcmtypes/README.md"
    assert (folder / page).read_text() == PAGES[page], "run ./scripts/show-messages"
