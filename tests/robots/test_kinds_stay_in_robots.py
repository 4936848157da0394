"""Nobody outside robots/ tests or lists the names of the kinds: they ask the type, or the table."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

from koopman_lab.robots.table import ROBOTS

ROOT = Path(__file__).parents[2]
PRODUCT = ("koopman_lab", "onboard", "offboard")
KINDS = ROBOTS.names()
NAMED = re.compile(rf"--robot[ =]({'|'.join(KINDS)})\b")


def sources() -> dict[str, str]:
    """Return the product's modules by their path."""
    listing = subprocess.run(
        ["git", "ls-files", *(f"{package}/**.py" for package in PRODUCT)],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    files = [Path(line) for line in listing.splitlines()]
    return {
        str(file): (ROOT / file).read_text()
        for file in files
        if file.parts[1] != "robots" and (ROOT / file).exists()
    }


def offences(text: str) -> list[tuple[int, str]]:
    """Return line and words of each string of a module that is a kind's name, or tells to say it.

    Docstrings are none: they explain, and examples in them name a robot.
    """
    tree, docstrings = ast.parse(text), set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            docstrings.add(id(body[0].value))
    return [
        (node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if id(node) not in docstrings
        if node.value.strip() in KINDS or NAMED.search(node.value)
    ]


def test_no_module_outside_robots_spells_a_kind():
    modules = sources()
    assert len(modules) > 100
    assert not {path: found for path, text in modules.items() if (found := offences(text))}


def test_no_type_is_a_list_of_kinds():
    for path, text in sources().items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith("Literal"):
                assert not any(kind in ast.unparse(node.slice) for kind in KINDS), path


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ('if config.robot.kind == "dynamic": pass', 1),
        ("TIMES = {'kinematic': 1.0, 'dynamic': 2.0}", 2),
        ('def f():\n    """Ask for kinematic."""\n    return f"{x}kinematic"', 1),
        ('raise DataError("say --robot kinematic or --robot dynamic")', 1),
        ('"""kinematic"""', 0),
        ('STEP = "kinematic-session"', 0),
        ('class A:\n    """Example: klab up --robot dynamic"""', 0),
    ],
)
def test_the_search_finds_what_it_should(text, count):
    assert len(offences(text)) == count
