"""Observables written as expressions, such as ``v*cos(theta)``: parsed, never run as Python.

What is allowed is little enough to list in an error message, and each of it means the same for
NumPy and CasADi.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from koopman_lab.errors import ModelError

Components = list[Any]
"""Numbers, arrays of equal shape, or CasADi symbols."""

FUNCTIONS = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "sqrt")
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
LARGEST_POWER = 9
LONGEST = 200
"""Largest number of characters; deeper nesting than that allows is never needed."""


def split(text: str) -> tuple[str, ...]:
    """Return the expressions of a list with commas; no expression holds one of its own."""
    return tuple(part.strip() for part in text.split(","))


@dataclass(frozen=True)
class Expressions:
    """Expressions of the components of a state, called like any dictionary's ``observables``.

    Parameters
    ----------
    texts
        The expressions.
    variables
        Names of the components.

    Raises
    ------
    ModelError
        If an expression holds anything that is not allowed; the message shows both.
    """

    texts: tuple[str, ...]
    variables: tuple[str, ...]

    def __post_init__(self) -> None:
        self._trees()

    def __call__(self, x: Components, m: Any) -> Components:
        """Return the values for components ``x``, with the functions of NumPy or CasADi."""
        values: dict[str, Any] = dict(zip(self.variables, x, strict=True)) | {"pi": math.pi}
        return [_value(tree, m, values) for tree in self._trees()]

    def _trees(self) -> list[ast.expr]:
        return [_parse(text, self.variables) for text in self.texts]


def canonical(text: str, variables: Sequence[str]) -> str:
    """Return an expression in one spelling, so that equal ones can be told.

    Raises
    ------
    ModelError
        If it holds anything that is not allowed.
    """
    return ast.unparse(_parse(text, tuple(variables)))


@lru_cache(maxsize=4096)
def _spelled(node: ast.expr) -> str:
    return ast.unparse(node)


def _value(node: ast.expr, m: Any, values: dict[str, Any]) -> Any:
    """Evaluate a checked tree; what occurs twice is computed once and shared in CasADi graphs."""
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]
    key = _spelled(node)
    if key not in values:
        values[key] = _compute(node, m, values)
    return values[key]


def _compute(node: ast.expr, m: Any, values: dict[str, Any]) -> Any:
    if isinstance(node, ast.UnaryOp):
        value = _value(node.operand, m, values)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp):
        if isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant):
            # A whole exponent: NumPy and CasADi multiply instead of taking logarithms.
            return _value(node.left, m, values) ** node.right.value
        left, right = _value(node.left, m, values), _value(node.right, m, values)
        return OPERATORS[type(node.op)](left, right)
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    return getattr(m, node.func.id)(_value(node.args[0], m, values))


@lru_cache(maxsize=4096)
def _parse(text: str, variables: tuple[str, ...]) -> ast.expr:
    problem = None
    if len(text) > LONGEST:
        problem = f"is longer than {LONGEST} characters"
    else:
        try:
            tree = ast.parse(text.replace("^", "**").strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            problem = "is no expression"
        else:
            problem = _forbidden(tree, variables)
    if problem is not None:
        raise ModelError(
            f"observable {text[:LONGEST]!r}: {problem}; allowed are numbers, "
            f"{', '.join(variables)}, pi, + - * / (), whole powers ^0 to ^{LARGEST_POWER}, and "
            f"{', '.join(FUNCTIONS)}"
        )
    return tree


def _forbidden(node: ast.expr, variables: tuple[str, ...]) -> str | None:
    """Return what of a tree is not allowed, None if all of it is."""
    if isinstance(node, ast.Constant):
        allowed = type(node.value) in (int, float) and math.isfinite(node.value)  # type: ignore[arg-type]
        return None if allowed else f"{node.value!r} is no number"
    if isinstance(node, ast.Name):
        allowed = node.id in variables or node.id == "pi"
        return None if allowed else f"there is no {node.id!r}"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.UAdd, ast.USub)):
        return _forbidden(node.operand, variables)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        if isinstance(node.op, ast.Pow):
            power = node.right.value if isinstance(node.right, ast.Constant) else None
            if type(power) is not int or not 0 <= power <= LARGEST_POWER:
                return f"{ast.unparse(node.right)!r} is no allowed power"
        return _forbidden(node.left, variables) or _forbidden(node.right, variables)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id not in FUNCTIONS:
            return f"there is no function {node.func.id!r}"
        if len(node.args) != 1 or node.keywords:
            return f"{node.func.id} takes one argument"
        return _forbidden(node.args[0], variables)
    return f"{ast.unparse(node)!r} is not allowed"
