"""A claim of the paper: numbers of ours, a rule for each, and the verdict that follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from koopman_lab.errors import DataError
from offboard.reproduction.paper.step_results import StepResults
from offboard.reproduction.paper.verdict import Rule, Verdict, number, worst


@dataclass(frozen=True)
class Part:
    """One number of a claim: its name, unit, the rule it must meet, and how it is read."""

    name: str
    unit: str
    rule: Rule
    measure: Callable[[StepResults], float]


@dataclass(frozen=True)
class Claim:
    """What the paper says.

    Attributes
    ----------
    name
        Stable, for tables.
    section
        Of the paper.
    sentence
        The sentence in our own words.
    paper
        The paper's number; empty where it prints none.
    parts
        All must hold.
    remark
        What to know when comparing; no verdict follows from it.
    """

    name: str
    section: str
    sentence: str
    paper: str
    parts: Sequence[Part]
    remark: str = ""


@dataclass(frozen=True)
class JudgedClaim:
    """A claim with its verdict.

    ``numbers`` are ours in words, a line each; ``weakest`` is the one that decided; ``rules`` what
    it takes to hold; ``steps`` where the numbers were read.
    """

    claim: Claim
    verdict: Verdict
    numbers: Sequence[str]
    weakest: str
    rules: Sequence[str]
    steps: Sequence[str]


def judge(claim: Claim, results: StepResults) -> JudgedClaim:
    """Return the verdict that follows from the numbers; a missing number is no verdict."""
    results.steps_read.clear()
    verdicts, numbers = [], []
    for part in claim.parts:
        try:
            value = part.measure(results)
        except DataError as error:
            verdicts.append(Verdict.UNKNOWN)
            numbers.append(f"{part.name}: {error}")
            continue
        verdicts.append(part.rule.judge(value))
        numbers.append(f"{part.name}: {number(value, part.unit)}")
    rules: dict[str, list[str]] = {}
    for part in claim.parts:
        rules.setdefault(part.rule.in_words(part.unit), []).append(part.name)
    if len(rules) == 1:
        texts = list(rules)
    else:
        texts = [f"{', '.join(names)}: {rule}" for rule, names in rules.items()]
    verdict = worst(verdicts)
    weakest = numbers[verdicts.index(verdict)]
    return JudgedClaim(claim, verdict, numbers, weakest, texts, tuple(results.steps_read))
