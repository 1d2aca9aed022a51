"""Random expressions of time: read as Python reads them, or refused; differentiated, and cut at their kinks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fuzzing import Random, survives

from softdyn.expression import FUNCTIONS, SEVERAL, evaluate, parse, pieces, value_and_slope, values

PLAIN = {name: function for name, function in FUNCTIONS.items() if name not in SEVERAL}
TIMES = (-3.7, 0.0, 1e-9, 0.3, 1.0, 12.5)


def grown(random: Random, depth: int) -> str:
    """A text of the grammar."""
    kind = int(random.integers(9)) if depth else 0
    if kind <= 1:
        return ["t", "pi", "q", "2", "0.5", "1e-3", ".25", "3.", "7e2"][int(random.integers(9))]
    inner = grown(random, depth - 1)
    if kind == 2:
        return f"-({inner})"
    if kind == 3:
        return f"{list(PLAIN)[int(random.integers(len(PLAIN)))]}({inner})"
    if kind == 4:
        return f"{SEVERAL[int(random.integers(2))]}({inner}, {grown(random, depth - 1)})"
    if kind == 5:
        return f"({inner})**{['2', '3', '-1', '0.5', '(1/3)', '0', '17'][int(random.integers(7))]}"
    sign = ["+", "-", "*", "/"][int(random.integers(4))]
    return f"({inner}){' ' * int(random.integers(2))}{sign}{grown(random, depth - 1)}"


def by_python(text: str, t: float) -> float:
    """What Python makes of a text that this file has made itself."""
    names = {**FUNCTIONS, "abs": math.fabs, "t": t, "pi": math.pi, "q": 1.7}
    try:
        value = eval(text, {"__builtins__": {}}, names)
        return float(value) if isinstance(value, (int, float)) else math.nan
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        return math.nan


@pytest.mark.slow
def test_texts_of_the_grammar_have_the_values_that_python_gives_them() -> None:
    random = np.random.default_rng(1)
    for _ in range(4000):
        text = grown(random, int(random.integers(1, 6)))
        expression = survives(lambda text=text: parse(text, {"q": 1.7}), text)
        assert expression is not None, text
        for t in TIMES:
            found, expected = evaluate(expression, t), by_python(text, t)
            assert found == pytest.approx(expected, rel=1e-9, abs=1e-300, nan_ok=True), (text, t)


@pytest.mark.slow
def test_values_at_many_times_are_those_at_each() -> None:
    random, t = np.random.default_rng(2), np.array(TIMES)
    for _ in range(2000):
        text = grown(random, int(random.integers(1, 5)))
        expression = parse(text, {"q": 1.7})
        many = survives(lambda e=expression: values(e.shape, t, e.constants), text)
        for k, when in enumerate(TIMES):
            alone = evaluate(expression, when)
            if math.isfinite(alone) and abs(alone) < 1e300:
                assert many[k] == pytest.approx(alone, rel=1e-9, abs=1e-12), (text, when)


@pytest.mark.slow
def test_mutated_texts_are_read_or_refused() -> None:
    """Characters put in, left out, or in another's place: never another error, whatever is done with what is read."""
    random = np.random.default_rng(3)
    letters = "t()+-*/.,eE0123456789 \t\nabcxyz_^%$#@!\"'\\{}[]é²\x00"
    read = 0
    for _ in range(6000):
        text = grown(random, int(random.integers(1, 6)))
        for _ in range(int(random.integers(1, 4))):
            at, kind = int(random.integers(len(text) + 1)), int(random.integers(3))
            more = letters[int(random.integers(len(letters)))] if kind else ""
            text = text[:at] + more + text[at + (kind != 1) :]
        expression = survives(lambda text=text: parse(text, {"q": 1.7}), repr(text))
        if expression is not None:
            read += 1
            survives(lambda e=expression: [evaluate(e, t) for t in TIMES], repr(text))
            survives(lambda e=expression: (value_and_slope(e.shape), pieces(e.shape)), repr(text))
    assert read > 500


@pytest.mark.slow
def test_monstrous_texts_are_read_or_refused_at_once() -> None:
    for text in (
        "(" * 5000, "-" * 9000 + "t", "t" + "+t" * 4000, "t**" * 500 + "t", "sin(" * 300 + "t" + ")" * 300, "1" * 9999,
        "1e" + "9" * 500, "t+" * 6000, "q" * 9000, "", " ", "\x00", "t\n\n", "max(t" + ",t" * 2000 + ")", "9**9**9**9",
        "-2**-2**-2", "t**-t", "0**0", "(-8)**(1/3)", "1e308*1e308", "log(-1)", "max()", "min(,)", "sin", "t t",
    ):  # fmt: skip
        expression = survives(lambda text=text: parse(text, {"q": 1.0}), repr(text[:60]))
        if expression is not None:
            survives(lambda e=expression: [evaluate(e, t) for t in TIMES], repr(text[:60]))
