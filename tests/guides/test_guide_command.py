"""`klab guide` shows the guides, from a checkout and from a wheel."""

import re

import pytest
from guide_pages.pages import PAGES, sections
from klab import klab, klab_ok

from offboard.commands.guide import GUIDES


def plain(text: str) -> str:
    return re.sub(r"\W+", " ", text)


@pytest.mark.parametrize("topic", GUIDES)
def test_each_page_is_shown_whole(topic):
    """Headings and the last words: what is between them is the library's that draws it."""
    shown = plain(klab_ok("guide", topic))
    page = GUIDES[topic].path
    for section in sections(page):
        assert plain(re.sub(r"[`*]", "", section.title)).strip() in shown
    last = PAGES[page].rstrip().splitlines()[-1]
    last = re.sub(r"\]\(.*?\)|<!--.*?-->|[`*|\[]", "", last)
    assert plain(last).strip() in shown
    assert "<!--" not in shown


def test_without_a_topic_it_says_which_there_are():
    lines = klab_ok("guide").splitlines()
    assert [line.split()[2] for line in lines] == list(GUIDES)
    assert all(len(line) <= 80 for line in lines)


def test_a_topic_that_there_is_not_is_one_message():
    done = klab("guide", "operators")
    assert done.returncode == 2
    assert "operator" in done.stderr
    assert len(done.stderr.splitlines()) == 1
