"""Expressions of time in scene files, read by a grammar of their own.

::

    sum     = product { ("+" | "-") product }
    product = signed { ("*" | "/") signed }
    signed  = ("+" | "-") signed | power
    power   = atom [ "**" signed ]
    atom    = number | name | function "(" sum ")" | "(" sum ")"

A name is ``t``, ``pi`` or one of the constants given with the expression; nothing is ever evaluated as code. Numbers
and constants are kept apart from the shape of the expression, so that one kernel serves every expression of a shape.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError

FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "abs": abs,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "atan": math.atan,
}
DEEPEST = 100
LONGEST = 10_000
#: Integer powers up to this one are products in the kernel; others go through pow.
LARGEST_POWER = 16

_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|[-+*/()]))")

#: ("time",), ("constant", index), ("neg", x), ("+" | "-" | "*" | "/", x, y), ("power", x, int or y), ("call", name, x)
Node = tuple


@dataclass(frozen=True)
class Expression:
    """A parsed expression: its shape, and the values of the numbers in it, in order."""

    text: str
    shape: Node
    constants: tuple[float, ...]

    @property
    def of_time(self) -> bool:
        """Whether t appears in it."""
        return _has_time(self.shape)


def parse(text: str, constants: Mapping[str, float] | None = None) -> Expression:
    """Parse an expression of t.

    Parameters
    ----------
    text : str
    constants : mapping from str to float, optional
        Named constants that the expression may use.

    Raises
    ------
    SceneError
        Where the text leaves the grammar, with the position.
    """
    return _Parser(text, dict(constants or {})).parse()


def evaluate(expression: Expression, t: float) -> float:
    """Value at time t, in plain Python: nan where the expression has none."""

    def value(node: Node) -> float:
        kind, *parts = node
        if kind == "time":
            return t
        if kind == "constant":
            return expression.constants[parts[0]]
        if kind == "neg":
            return -value(parts[0])
        if kind == "call":
            return FUNCTIONS[parts[0]](value(parts[1]))
        left = value(parts[0])
        if kind == "power":
            power = left ** (parts[1] if isinstance(parts[1], int) else value(parts[1]))
            return power if isinstance(power, float) else math.nan
        right = value(parts[1])
        return {"+": left + right, "-": left - right, "*": left * right}[kind] if kind != "/" else left / right

    try:
        return float(value(expression.shape))
    except (ValueError, ZeroDivisionError, OverflowError):
        return math.nan


#: Points of a run at which the sign of an argument of abs is looked at.
POINTS = 4097


def kinks(shape: Node, constants: NDArray[np.float64], start: float, end: float) -> NDArray[np.float64]:
    """Times between two at which an argument of abs changes sign, in order: to the last digit, by bisection.

    An argument that changes sign twice between two of POINTS times is not found out.
    """
    found: list[NDArray[np.float64]] = []
    if not math.isfinite(end):
        return np.empty(0)
    for argument in _arguments_of_abs(shape):

        def sign(t: NDArray[np.float64], argument: Node = argument) -> NDArray[np.float64]:
            with np.errstate(all="ignore"):
                return np.sign(np.broadcast_to(_values(argument, t, constants), t.shape))

        t = np.linspace(start, end, POINTS)
        signs = sign(t)
        low, high = t[:-1][signs[:-1] * signs[1:] < 0], t[1:][signs[:-1] * signs[1:] < 0]
        before = sign(low)
        for _ in range(1100):
            middle = low + (high - low) / 2
            open_ = (low < middle) & (middle < high)
            if not open_.any():
                break
            same = sign(middle) == before
            low, high = np.where(open_ & same, middle, low), np.where(open_ & ~same, middle, high)
        found += [high, t[signs == 0]]
    times = np.unique(np.concatenate(found)) if found else np.empty(0)
    return times[(start < times) & (times < end)]


def has_kinks(shape: Node) -> bool:
    """Whether an expression has an abs whose argument depends on the time."""
    return bool(_arguments_of_abs(shape))


def _arguments_of_abs(node: Node) -> list[Node]:
    inside = [found for part in node[1:] if isinstance(part, tuple) for found in _arguments_of_abs(part)]
    return [*inside, node[2]] if node[:2] == ("call", "abs") and _has_time(node[2]) else inside


def _values(node: Node, t: NDArray[np.float64], constants: NDArray[np.float64]) -> Any:
    """Values of an expression at many times."""
    kind, *parts = node
    if kind == "time":
        return t
    if kind == "constant":
        return constants[parts[0]]
    if kind == "call":
        name = {"atan": "arctan"}.get(parts[0], parts[0])
        return getattr(np, name)(_values(parts[1], t, constants))
    left = _values(parts[0], t, constants)
    if kind == "neg":
        return -left
    right = parts[1] if isinstance(parts[1], int) else _values(parts[1], t, constants)
    operations = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "power": np.power}
    return operations[kind](left, right)


def _has_time(node: Node) -> bool:
    return node[0] == "time" or any(_has_time(part) for part in node[1:] if isinstance(part, tuple))


class _Parser:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str, names: dict[str, float]) -> None:
        if len(text) > LONGEST:
            raise SceneError(f"an expression of {len(text)} characters is too long; {LONGEST} are allowed")
        self.text, self.names = text, names
        self.constants: list[float] = []
        self.depth = 0
        self.tokens = self._tokens()
        self.next = 0

    def _tokens(self) -> list[tuple[str, str, int]]:
        tokens, at = [], 0
        end = len(self.text.rstrip())
        while at < end:
            match = _TOKEN.match(self.text, at)
            if match is None:
                at += len(self.text[at:]) - len(self.text[at:].lstrip())
                hint = "; a power is written **" if self.text[at] == "^" else ""
                raise self._error(f"{self.text[at]!r} is not part of the grammar{hint}", at)
            kind = ("number", "name", "operator")[(match.lastindex or 1) - 1]
            tokens.append((kind, match.group(match.lastindex or 1), match.start(match.lastindex or 1)))
            at = match.end()
        return [*tokens, ("end", "", end)]

    def _error(self, message: str, at: int) -> SceneError:
        shown = self.text if len(self.text) <= 120 else self.text[:120] + "..."
        return SceneError(f"expression {shown!r}, position {at + 1}: {message}")

    def _take(self, *texts: str) -> str | None:
        kind, text, _ = self.tokens[self.next]
        if kind == "operator" and text in texts:
            self.next += 1
            return text
        return None

    def parse(self) -> Expression:
        shape = self._sum()
        kind, text, at = self.tokens[self.next]
        if kind != "end":
            raise self._error(f"{text!r} does not belong here; an operator or the end is expected", at)
        return Expression(self.text, shape, tuple(self.constants))

    def _constant(self, value: float) -> Node:
        self.constants.append(value)
        return ("constant", len(self.constants) - 1)

    def _sum(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._error(f"nested more than {DEEPEST} deep", self.tokens[self.next][2])
        node = self._product()
        while operator := self._take("+", "-"):
            node = (operator, node, self._product())
        self.depth -= 1
        return node

    def _product(self) -> Node:
        node = self._signed()
        while operator := self._take("*", "/"):
            node = (operator, node, self._signed())
        return node

    def _signed(self) -> Node:
        minus = False
        while operator := self._take("+", "-"):
            minus ^= operator == "-"
        node = self._power()
        return ("neg", node) if minus else node

    def _power(self) -> Node:
        base = self._atom()
        if not self._take("**"):
            return base
        kind, text, _ = self.tokens[self.next]
        after = self.tokens[self.next + 1][1] if kind == "number" else ""
        if kind == "number" and text.isdigit() and 2 <= int(text[:4]) <= LARGEST_POWER and after != "**":
            self.next += 1
            return ("power", base, int(text))
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._error(f"nested more than {DEEPEST} deep", self.tokens[self.next][2])
        node = ("power", base, self._signed())
        self.depth -= 1
        return node

    def _atom(self) -> Node:
        kind, text, at = self.tokens[self.next]
        self.next += 1
        if kind == "number":
            if not math.isfinite(float(text)):
                raise self._error(f"{text} is larger than a double can hold", at)
            return self._constant(float(text))
        if kind == "name":
            return self._name(text, at)
        if text == "(":
            node = self._sum()
            if not self._take(")"):
                raise self._error(
                    f"the parenthesis opened at position {at + 1} is not closed", self.tokens[self.next][2]
                )
            return node
        self.next -= 1
        found = repr(text) if text else "the end"
        raise self._error(f"{found} where a number, a name or a parenthesis is expected", at)

    def _name(self, name: str, at: int) -> Node:
        called = self.tokens[self.next][1] == "("
        if name in FUNCTIONS:
            if not self._take("("):
                raise self._error(f"function {name!r} needs an argument in parentheses", at)
            argument = self._sum()
            if not self._take(")"):
                raise self._error(f"the argument of {name!r} is not closed", self.tokens[self.next][2])
            return ("call", name, argument)
        if called:
            near = get_close_matches(name, FUNCTIONS, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(FUNCTIONS)}"
            raise self._error(f"unknown function {name!r}{hint}", at)
        if name == "t":
            return ("time",)
        if name in self.names:
            return self._constant(float(self.names[name]))
        if name == "pi":
            return self._constant(math.pi)
        near = get_close_matches(name, [*self.names, "t", "pi", *FUNCTIONS], n=1)
        hint = f"; did you mean {near[0]!r}?" if near else "; define it among the constants"
        raise self._error(f"unknown name {name!r}{hint}", at)
