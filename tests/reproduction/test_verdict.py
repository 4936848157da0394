"""Verdicts on both sides of each threshold."""

import math

import pytest

from offboard.reproduction.paper.verdict import AtLeast, AtMost, Near, Same, Verdict, number, worst

HOLDS, WEAKER, NOT, UNKNOWN = Verdict.HOLDS, Verdict.WEAKER, Verdict.NOT, Verdict.UNKNOWN


@pytest.mark.parametrize(
    ("rule", "value", "verdict"),
    [
        (AtMost(2.0, 4.0), 2.0, HOLDS),
        (AtMost(2.0, 4.0), 2.001, WEAKER),
        (AtMost(2.0, 4.0), 4.0, WEAKER),
        (AtMost(2.0, 4.0), 4.001, NOT),
        (AtLeast(0.5, 0.25), 0.5, HOLDS),
        (AtLeast(0.5, 0.25), 0.499, WEAKER),
        (AtLeast(0.5, 0.25), 0.25, WEAKER),
        (AtLeast(0.5, 0.25), 0.249, NOT),
        (Near(100.0), 90.0, HOLDS),
        (Near(100.0), 110.0, HOLDS),
        (Near(100.0), 89.9, WEAKER),
        (Near(100.0), 200.0, WEAKER),
        (Near(100.0), 200.1, NOT),
        (Near(100.0), 49.9, NOT),
        (Same(0.05), 0.05, HOLDS),
        (Same(0.05), 0.051, NOT),
        (Same(0.0), 0.0, HOLDS),
    ],
)
def test_a_rule_judges_by_its_limits(rule, value, verdict):
    assert rule.judge(value) is verdict


@pytest.mark.parametrize("rule", [AtMost(1.0, 2.0), AtLeast(1.0, 0.5), Near(1.0), Same(1.0)])
def test_what_is_not_a_number_never_holds(rule):
    assert rule.judge(math.nan) is NOT


def test_rules_say_their_limits():
    assert AtMost(2.0, 4.0).in_words("mm") == "at most 2 mm (weaker: 4 mm)"
    assert AtLeast(0.75, 0.5).in_words("share") == "at least 75 % (weaker: 50 %)"
    assert AtLeast(1.0, 1.0).in_words("") == "at least 1"
    assert Near(119.67).in_words("s") == "within 10 % of 120 s (weaker: within a factor of 2)"
    assert Same(240.0).in_words("Hz") == "equal to 240 Hz"


def test_the_weakest_part_decides_and_a_missing_one_never_holds():
    assert worst([HOLDS, HOLDS]) is HOLDS
    assert worst([HOLDS, WEAKER]) is WEAKER
    assert worst([WEAKER, UNKNOWN, HOLDS]) is UNKNOWN
    assert worst([UNKNOWN, NOT]) is NOT


def test_numbers_are_written_with_their_units():
    assert number(0.005251, "mm") == "0.00525 mm"
    assert number(108106.0, "") == "108106"
    assert number(90906.7, "times") == "90907 times"
    assert number(1.26e11, "times") == "1.26e+11 times"
    assert number(0.756, "share") == "75.6 %"
    assert number(math.inf, "mm") == "inf mm"
