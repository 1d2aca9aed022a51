"""The value of a formula in LaTeX, read back with nothing of the code that wrote it."""

import math
import re
from collections.abc import Mapping

COMMANDS = re.compile(r"\\left\(|\\right\)|\\left\||\\right\||\\[a-zA-Z]+|\\,|\d+|[-+/^{}()\[\]|a-zA-Z]|\s+")

ENDS = ("", "+", "-", "}", "]", ")", r"\right)", r"\right|")


class Reader:
    """A descending parser of sums of products of powers; ``names`` are typeset names and their values."""

    def __init__(self, latex: str, names: Mapping[str, float]) -> None:
        self.names = {r"\pi": math.pi, "e": math.e, **names}
        longest = sorted(map(re.escape, self.names), key=len, reverse=True)
        known = re.compile(
            "|".join(f"{name}(?![a-zA-Z_])" if name[-1].isalpha() and "\\" in name else name for name in longest)
        )
        self.tokens: list[str] = []
        self.bars = 0
        at = 0
        while at < len(latex):
            match = known.match(latex, at) or COMMANDS.match(latex, at)
            assert match, f"{latex[at:]} in {latex}"
            at = match.end()
            if match[0].strip() and match[0] not in (r"\,", r"\cdot"):
                self.tokens.append(match[0])

    def next(self) -> str:
        return self.tokens[0] if self.tokens else ""

    def take(self, expected: str = "") -> str:
        token = self.tokens.pop(0)
        assert token == expected or not expected, f"{token} where {expected} should be"
        return token

    def group(self, opening: str = "{", closing: str = "}") -> float:
        self.take(opening)
        value = self.sum()
        self.take(closing)
        return value

    def sum(self) -> float:
        sign = -1.0 if self.next() == "-" and self.take() else 1.0
        total = sign * self.product()
        while self.next() in ("+", "-"):
            total += (1.0 if self.take() == "+" else -1.0) * self.product()
        return total

    def product(self) -> float:
        value = self.power()
        while self.next() not in ENDS and not (self.next() == "|" and self.bars):
            value = value / self.power() if self.next() == "/" and self.take() else value * self.power()
        return value

    def power(self) -> float:
        base = self.atom()
        return base ** self.group() if self.next() == "^" and self.take() else base

    def atom(self) -> float:
        token = self.take()
        if token in self.names:
            return self.names[token]
        if token.isdigit():
            return float(token)
        if token == "{":
            value = self.sum()
            self.take("}")
            return value
        if token in ("(", r"\left("):
            value = self.sum()
            self.take(")" if token == "(" else r"\right)")
            return value
        if token in ("|", r"\left|"):
            self.bars += 1
            value = abs(self.sum())
            self.bars -= 1
            self.take("|" if token == "|" else r"\right|")
            return value
        if token == r"\frac":
            return self.group() / self.group()
        if token == r"\sqrt":
            index = self.group("[", "]") if self.next() == "[" else 2.0
            return self.group() ** (1 / index)
        if token in (r"\ln", r"\exp", r"\tanh"):
            return getattr(math, {"ln": "log"}.get(token[1:], token[1:]))(self.atom())
        raise AssertionError(f"{token} is no formula")


def value(latex: str, names: Mapping[str, float]) -> float:
    """Value of a formula for values of its names."""
    reader = Reader(latex, names)
    result = reader.sum()
    assert not reader.tokens, f"{reader.tokens} left of {latex}"
    return result
