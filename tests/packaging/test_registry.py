"""One table: our own rows and those of other packages, and every way in which those do not fit."""

from typing import NamedTuple

import pytest
from plugin_package import install

from koopman_lab.errors import ConfigError, PluginError
from koopman_lab.registry import NAME, Registry


class Fruit(NamedTuple):
    name: str
    peel: str = ""


OWN = Fruit("apple")
ROW = "from test_registry import Fruit\nROW = Fruit('{}')\n"


@pytest.fixture
def table(request):
    """Return a table of fruit whose group is this test's alone."""
    group = f"koopman_lab.test.{request.node.name.encode().hex()}"
    return Registry("fruit", group, Fruit, {"apple": OWN})


@pytest.fixture
def added(table, tmp_path, monkeypatch):
    """Return what installs a package that adds rows of the table."""

    def add(rows, modules, **options):
        folder = tmp_path / options.get("name", "stranger")
        install(folder, {table.group: rows}, modules, **options)
        monkeypatch.syspath_prepend(str(folder))

    return add


def test_our_own_rows_come_first_and_all_names_are_known_without_an_import(table, added):
    added({"pear": "orchard_absent:PEAR", "fig": "orchard_absent:FIG"}, {})
    assert table.names() == ("apple", "fig", "pear")
    assert table.plugin_names() == ("fig", "pear")
    assert table.builtin_names() == ("apple",)
    assert "pear" in table
    assert "plum" not in table


def test_a_row_of_another_package_is_used_like_our_own(table, added):
    added({"pear": "orchard_good:ROW"}, {"orchard_good": ROW.format("pear")})
    assert table.get("pear") == Fruit("pear")
    assert list(table) == [OWN, Fruit("pear")]
    assert table.builtin_row("pear") is None
    assert not table.faults()
    assert table.origin("pear") == "fruit 'pear' of the package klab-stranger"


FAULTS = {
    "not there": ("orchard_none:ROW", None, "ModuleNotFoundError: No module named"),
    "no such object": ("orchard_empty:ROW", "", "has no attribute 'ROW'"),
    "breaks on import": ("orchard_breaks:ROW", "1 / 0\n", "ZeroDivisionError"),
    "finds no device": ("orchard_device:ROW", "raise OSError('no device')\n", "no device"),
    "ends the process": ("orchard_exits:ROW", "raise SystemExit(5)\n", "SystemExit: 5"),
    "another type": ("orchard_type:ROW", "ROW = 'pear'\n", "is of type str, expected Fruit"),
    "another name": ("orchard_name:ROW", ROW.format("plum"), "calls itself 'plum'"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_whatever_is_wrong_with_a_row_is_one_message_and_the_rest_goes_on(table, added, fault):
    where, text, said = FAULTS[fault]
    added({"pear": where}, {} if text is None else {where.split(":")[0]: text})
    with pytest.raises(PluginError) as error:
        table.get("pear")
    message = str(error.value)
    assert message.startswith("fruit 'pear' of the package klab-stranger")
    assert said in message
    assert where in message
    assert message.endswith("mend or uninstall it")
    assert "\n" not in message
    assert table.faults() == {"pear": message}
    assert list(table) == [OWN]
    assert table.get("apple") is OWN


@pytest.mark.parametrize(
    ("requires", "fits"),
    [
        ("koopman-lab", True),
        ("koopman_lab>=0.1", True),
        ("Koopman.Lab<99", True),
        ("numpy<1", True),
        ("not a requirement", True),
        ("koopman-lab>=99", False),
        ("koopman-lab==0.0.1; python_version >= '3'", False),
        ("Koopman.Lab>=99", False),
        ("koopman-lab>=99; python_version < '3'", True),
    ],
)
def test_a_package_for_another_version_is_refused(table, added, requires, fits, request):
    module = f"orchard_version_{request.node.callspec.id.encode().hex()}"
    added({"pear": f"{module}:ROW"}, {module: ROW.format("pear")}, requires=requires)
    if fits:
        assert table.get("pear") == Fruit("pear")
        return
    with pytest.raises(
        PluginError, match=r"'pear' of the package klab-stranger is for koopman-lab"
    ):
        table.get("pear")


def test_two_packages_with_a_row_of_one_name_are_both_named(table, added):
    added({"pear": "orchard_first:ROW"}, {"orchard_first": ROW.format("pear")}, name="first")
    added({"pear": "orchard_second:ROW"}, {"orchard_second": ROW.format("pear")}, name="second")
    with pytest.raises(
        PluginError, match=r"'pear' is in (first and in second|second and in first)"
    ):
        table.get("pear")
    assert table.names() == ("apple", "pear")


def test_a_row_named_as_ours_is_refused_as_well(table, added):
    added({"apple": "orchard_apple:ROW"}, {"orchard_apple": ROW.format("apple")})
    with pytest.raises(PluginError, match=r"'apple' is in koopman-lab and in klab-stranger"):
        table.get("apple")
    assert table.builtin_row("apple") is OWN
    assert list(table.faults()) == ["apple"]


def test_an_unknown_name_lists_the_known_ones_and_the_nearest(table):
    with pytest.raises(
        ConfigError, match=r"unknown fruit 'aple', known: apple; did you mean apple"
    ):
        table.get("aple")


@pytest.mark.parametrize("name", ["Pear", "pear-tree", "1pear", "p" * 31, "birne "])
def test_names_that_nobody_can_type_are_a_fault_and_no_row(table, added, name):
    added({name: "orchard_case:ROW"}, {"orchard_case": ROW.format("pear")})
    assert not NAME.fullmatch(name)
    assert table.names() == ("apple",) or name.strip() in table.names()


def test_a_row_may_say_where_its_parts_are(table, added):
    added({"pear": "orchard_parts:ROW"}, {"orchard_parts": ROW.format("pear") + "PEEL = 'green'\n"})
    assert table.load("pear", "orchard_parts:PEEL") == "green"
    assert table.load("pear", 5) == 5
    with pytest.raises(PluginError, match=r"klab-stranger \(orchard_parts:CORE\) cannot be loaded"):
        table.load("pear", "orchard_parts:CORE")


def test_a_script_adds_a_row_for_its_own_process(table):
    plum = Fruit("plum")
    table.register("plum", plum)
    assert table.get("plum") is plum
    assert "plum" in table.plugin_names()
    with pytest.raises(ConfigError, match="'plum' is there already"):
        table.register("plum", Fruit("plum"))
    with pytest.raises(ConfigError, match="'apple' is there already"):
        table.register("apple", OWN)
    table.unregister("plum")
    assert table.names() == ("apple",)
