"""Many expressions at one point: the values are those of each by itself, and what they share is computed once."""

import math

import mpmath
import numpy as np
import pytest
from sympy import Abs, Max, Piecewise, Rational, Symbol, erfc, exp, log, pi, sqrt

from softdyn.derive.evaluation import Program
from softdyn.derive.laws.droplet import law as droplet
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.witness import GUARDED, compiled
from softdyn.study.plane import deflection_at, deflections

x, y = Symbol("x", positive=True), Symbol("y", real=True)
FUNCTIONS = {**GUARDED, "Abs": abs, "Add": lambda *terms: mpmath.fsum(terms)}


def other(node):
    arguments = sorted(node.free_symbols, key=str)
    return arguments, compiled(arguments, node)


@pytest.mark.parametrize(
    "expr",
    [
        Rational(2, 7) * x / (3 * y**2) - 5,
        sqrt(x) * (x + y) ** Rational(-3, 2) + (1 + x) ** Rational(1, 3) / pi,
        x**y * exp(-x / 3) * log(1 + x / 2) * Abs(y - 4),
        Max(x, y) * erfc(x) + x ** sqrt(2),
        Piecewise((log(y), y > x), (x**2 / y, (y > 0) & (x < 7)), (x, True)),
        Piecewise((x, y >= 0), (log(y), True)),
    ],
)
def test_a_program_gives_the_values_of_expressions(expr) -> None:
    program = Program([expr, 2 * expr], FUNCTIONS, other)
    with mpmath.workdps(40):
        expected = mpmath.mpf(str(expr.subs({x: Rational(17, 10), y: Rational(3, 5)}).evalf(40)))
        values = {x: mpmath.mpf(17) / 10, y: mpmath.mpf(3) / 5}
        known = program.start(values)
        assert mpmath.almosteq(program.value(known, expr), expected, 1e-37)
        assert mpmath.almosteq(program.value(known, 2 * expr), 2 * expected, 1e-37)


def test_what_is_shared_is_computed_once_and_a_branch_that_does_not_apply_never() -> None:
    asked = []

    def logarithm(value):
        asked.append(value)
        return mpmath.log(value)

    shared, refused = log(1 + x), log(y)
    whole = shared**2 + 3 / shared + Piecewise((refused, y > 5), (x, True))
    program = Program([whole], {**FUNCTIONS, "log": logarithm}, other)
    known = program.start({x: mpmath.mpf(2), y: mpmath.mpf(-1)})
    assert mpmath.almosteq(program.value(known, whole), mpmath.log(3) ** 2 + 3 / mpmath.log(3) + 2)
    assert program.value(known, shared) == mpmath.log(3)
    assert asked == [3]
    with pytest.raises(ValueError, match="has no value"):
        program.value(program.start({x: mpmath.mpf(2)}), refused)


@pytest.mark.parametrize("law", [droplet, rognon_gay])
@pytest.mark.parametrize("side", ["compression", "tension"])
@pytest.mark.parametrize("force", [1e-12, 1e-4, 1e3])
def test_one_deflection_is_that_of_many(law, side, force) -> None:
    many = deflections(law, side, np.array([1e-9, 1e-3]), np.array([force]))
    one = [deflection_at(law, side, gap, force) for gap in (1e-9, 1e-3)]
    # both halve down to the last bit, and their functions differ by less than four of these
    assert one == pytest.approx(many, rel=4 * 2**-52, nan_ok=True)
    assert math.isnan(one[0]) == (force == 1e3)
