"""The page of threats names, for each, the tests that hold it off; they must be there."""

import ast
import re

from guide_pages.pages import ROOT

PAGE = (ROOT / ".github" / "SECURITY.md").read_text()
ROWS = PAGE.partition("## What is tested")[2].partition("\n## ")[0]
NAMED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")


def test_each_row_names_tests_that_are_there():
    rows = [line for line in ROWS.splitlines() if line.startswith("| ")][1:]
    assert len(rows) == 15
    for row in rows:
        named = NAMED.findall(row)
        assert named, row
        for file, test in named:
            tree = ast.parse((ROOT / file).read_text())
            assert test in {node.name for node in ast.walk(tree) if hasattr(node, "name")}, row
