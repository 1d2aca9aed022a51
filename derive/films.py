"""Equilibrium films: gaps at which the remote force carries the external one, F_adh = F.

Input: a law with F_adh, and its regimes. Output: each film's gap h_eq(F), whether it is stable, and the rate at which a
gap near it relaxes, in leading form on the crossovers where dh/dt changes sign, in closed form where F_adh can be
inverted, and in numbers for the law's typical parameters.

Near a film dh/dt = -(F - F_adh)/zeta is linear in h - h_eq: the rate is -(dF_adh/dh)/zeta, along delta(h) at given F.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sympy import Add, Eq, Expr, Mul, Pow, S, Symbol, diff, exp, lambdify, log, powsimp, simplify

from softdyn.derive import dynamics as d
from softdyn.derive.asymptotics import UndecidedError, expand, leading, scale_of
from softdyn.derive.balance import definitions, size
from softdyn.derive.dynamics import F_a, a_delta, a_h
from softdyn.derive.law import sample_values
from softdyn.derive.regimes import SIGN, Diagram, Regime, Side, force
from softdyn.derive.symbols import COMMON_PARAMETERS, F, a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw


@dataclass(frozen=True)
class Film:
    """A film between two regimes, one in which the gap closes and one in which it opens.

    Attributes
    ----------
    closing, opening : str
        The regimes on its two sides: dh/dt < 0 in the first, > 0 in the second. A gap comes to the film, or leaves it,
        through these.
    side : "compression" or "tension"
    stable : bool or None
        Whether the gap closes above the film and opens below it; None if both regimes lie at the same gaps, so that
        the line is an edge: a force beyond which there is no film.
    h_eq : Expr or None
        Leading form of the film's gap, in F; in closed form where the leading form holds up to logarithms only.
    rate : Expr or None
        Leading form of the relaxation rate, in h_eq (as h) and F; < 0 for an unstable film.
    edge : Expr or None
        The force at the edge, if it is one.
    """

    closing: str
    opening: str
    side: Side
    stable: bool | None
    h_eq: Expr | None
    rate: Expr | None
    edge: Expr | None


@dataclass(frozen=True)
class Branch:
    """A continuous family of films, at the law's typical parameters, in units R = E = eta = 1.

    ``h``, ``force`` and ``rate`` are sampled at growing gaps; a branch ends where its stability changes, at an extremum
    of the force, or at the end of the range of gaps.
    """

    stable: bool
    h: tuple[float, ...]
    force: tuple[float, ...]
    rate: tuple[float, ...]


@dataclass(frozen=True)
class Films:
    """All that is known of a law's films.

    Attributes
    ----------
    films : tuple of Film
    h_eq : Expr or None
        The film's gap in closed form, where F_adh depends on h alone and can be inverted.
    rate : Expr
        The relaxation rate, exact, in h (= h_eq) and delta.
    branches : tuple of Branch
    """

    films: tuple[Film, ...]
    h_eq: Expr | None
    rate: Expr
    branches: tuple[Branch, ...]


def find_films(diagram: Diagram) -> Films | None:
    """Find the films of a law; None if it has no F_adh."""
    law = diagram.law
    if law.F_adh == 0:
        return None
    closed = inverted(law.F_adh, h, F) if not law.F_adh.has(a) else None
    films = tuple(film for crossover in diagram.crossovers if (film := _film(diagram, crossover, closed)) is not None)
    return Films(films, closed, relaxation_rate(law), branches(law))


def relaxation_rate(law: ContactLaw) -> Expr:
    """Return -(dF_adh/dh)/zeta along delta(h) at constant force, in a, h and delta."""
    along = diff(law.F_adh, h)
    through_a = diff(law.F_adh, a)
    if through_a != 0:
        known = definitions(law)
        slope = -known[F_a] * known[a_h] / (known[F_a] * known[a_delta] + known[d.F_delta])
        along += through_a * (known[a_h] + known[a_delta] * slope)
    return -along / law.zeta


def inverted(expr: Expr, symbol: Symbol, value: Expr) -> Expr | None:
    """Solve expr = value for a positive symbol that occurs in it once; None if it does not, or cannot be undone."""
    while expr != symbol:
        holding = [part for part in expr.args if part.has(symbol)]
        if len(holding) != 1:
            return None
        (inner,) = holding
        if isinstance(expr, Add):
            value = value - (expr - inner)
        elif isinstance(expr, Mul):
            value = value / (expr / inner)
        elif isinstance(expr, Pow) and inner == expr.base and expr.exp.is_number:
            value = value ** (1 / expr.exp)
        elif isinstance(expr, exp):
            value = log(value)
        elif isinstance(expr, log):
            value = exp(value)
        else:
            return None
        expr = inner
    return powsimp(value)


# -------------------------------------------------------------------------------------------------- between regimes


def _film(diagram: Diagram, crossover: object, closed: Expr | None) -> Film | None:
    one, other = (diagram.regime(name, crossover.side) for name in (crossover.first, crossover.second))  # type: ignore[attr-defined]
    if not all("dh_dt" in regime.forms for regime in (one, other)):
        return None
    signs = [regime.forms["dh_dt"].leading.could_extract_minus_sign() for regime in (one, other)]
    if signs[0] == signs[1]:
        return None
    closing, opening = (one, other) if signs[0] else (other, one)
    line: Eq = crossover.line  # type: ignore[attr-defined]
    side: Side = crossover.side  # type: ignore[attr-defined]
    if line.lhs == force and h not in line.rhs.free_symbols:
        return Film(closing.name, opening.name, side, None, None, None, SIGN[side] * line.rhs)
    above = _at_larger_gaps(closing, line)
    h_eq = _film_gap(line)
    if h_eq is None or closed is not None:
        h_eq = closed.subs(F, SIGN[side] * force) if closed is not None else None
    return Film(closing.name, opening.name, side, above, h_eq, _leading_rate(diagram, closing, opening, side), None)


def _at_larger_gaps(closing: Regime, line: Eq) -> bool:
    """Whether a regime lies at larger gaps than a line, at the same force."""
    for condition in closing.conditions:
        if {condition.small, condition.large} == {line.lhs, line.rhs}:
            if line.lhs == h:
                return bool(condition.small == line.rhs)
            grows = simplify(h * diff(line.rhs, h) / line.rhs).is_positive
            # F << f(h): larger gaps, if f grows with h
            return bool((condition.small == force) == grows)
    return False


def _film_gap(line: Eq) -> Expr | None:
    if line.lhs == h:
        return None
    return inverted(line.rhs, h, force)


def _leading_rate(diagram: Diagram, closing: Regime, opening: Regime, side: Side) -> Expr | None:
    """F (-dln F_adh/dh)/zeta: what the rate is where F_adh = F, to leading order, in h = h_eq and F."""
    law = diagram.law
    if law.F_adh.has(a) or "zeta" not in closing.forms:
        return None
    slope = -powsimp(simplify(diff(law.F_adh, h) / law.F_adh))
    directions = {h: (1, 0, 0), size: (0, 1, 0), **{s: (0, 0, n) for s, n in diagram.scales.items()}}
    for regime in (opening, closing):
        cone = regime.cones[0]
        try:
            steepness = leading(expand(slope, scale_of(cone, {s: n[: len(cone[0])] for s, n in directions.items()})))[1]
        except UndecidedError:
            continue
        return powsimp(SIGN[side] * force * steepness / closing.forms["zeta"].leading)
    return None


# ------------------------------------------------------------------------------------------------------- in numbers

#: Gaps, in units of R, at which films are looked for.
GAPS = (1e-10, 1e2)
#: Gaps per decade.
DENSITY = 40


def branches(law: ContactLaw) -> tuple[Branch, ...]:
    """Films at the law's typical parameters, by branches; R = E = eta = 1.

    At each gap, the force that F_adh carries there is the film's; where it falls with the gap the film is stable.
    """
    numbers = {**dict.fromkeys(COMMON_PARAMETERS, S.One), **sample_values(law)}
    arguments = (a, h, delta)
    known = {s: e.subs(numbers) for s, e in definitions(law).items()}
    remote = lambdify(arguments, law.F_adh.subs(numbers), "math")
    elastic = lambdify(arguments, known[F], "math")
    radius = lambdify((h, delta), law.a.subs(numbers), "math")
    rate = lambdify(arguments, relaxation_rate(law).subs(numbers), "math")
    count = round(DENSITY * math.log10(GAPS[1] / GAPS[0]))
    found: list[tuple[float, float, float]] = []
    for i in range(count + 1):
        gap = GAPS[0] * (GAPS[1] / GAPS[0]) ** (i / count)
        try:
            deflection = _deflection(
                lambda x, gap=gap: elastic(radius(gap, x), gap, x) - remote(radius(gap, x), gap, x)
            )
            at = (radius(gap, deflection), gap, deflection)
            found.append((gap, float(remote(*at)), float(rate(*at))))
        except (OverflowError, ZeroDivisionError, ValueError):
            continue
    return tuple(_branches([point for point in found if all(map(math.isfinite, point)) and point[1] != 0]))


def _deflection(excess: object) -> float:
    """Return the zero of a function of delta in (-1, 1), by bisection.

    Raises
    ------
    ValueError
        If there is none: the film presses deeper than R.
    """
    at_rest = excess(0.0)  # type: ignore[operator]
    if at_rest == 0:
        return 0.0
    sign = -1.0 if at_rest > 0 else 1.0
    low, high = 0.0, sign * 1e-18
    while (excess(high) > 0) == (at_rest > 0):  # type: ignore[operator]
        low, high = high, 2 * high
        if abs(high) > 1:
            raise ValueError("no deflection below R")
    for _ in range(60):
        middle = (low + high) / 2
        if (excess(middle) > 0) == (at_rest > 0):  # type: ignore[operator]
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _branches(points: Sequence[tuple[float, float, float]]) -> list[Branch]:
    """Cut a curve of films where its stability, or the sign of its force, changes."""
    runs: list[list[tuple[float, float, float]]] = []
    for point in points:
        key = (point[2] > 0, point[1] > 0)
        if runs and (runs[-1][-1][2] > 0, runs[-1][-1][1] > 0) == key:
            runs[-1].append(point)
        else:
            runs.append([point])
    return [
        Branch(run[0][2] > 0, *(tuple(values) for values in zip(*run, strict=True))) for run in runs if len(run) > 1
    ]
