"""Equilibrium films: gaps at which the remote force carries the external one, F_adh = F.

Input: a law with F_adh, and its regimes. Output: each film's gap h_eq(F), whether it is stable, and the rate at which a
gap near it relaxes, in leading form on the crossovers where dh/dt changes sign, in closed form where F_adh can be
inverted, and in numbers for the law's typical parameters.

Near a film dh/dt = -(F - F_adh)/zeta is linear in h - h_eq: the rate is -(dF_adh/dh)/zeta, along delta(h) at given F.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from sympy import (
    Add,
    Dummy,
    Expr,
    Mul,
    Pow,
    S,
    Symbol,
    acosh,
    asinh,
    atanh,
    cosh,
    coth,
    diff,
    exp,
    fraction,
    lambdify,
    log,
    powsimp,
    simplify,
    sinh,
    sqrt,
    tanh,
    together,
)
from sympy.codegen.cfunctions import expm1, log1p

from softdyn.derive import dynamics as d
from softdyn.derive.asymptotics import UndecidedError, expand, leading, scale_of
from softdyn.derive.cones import Cone, Normal, dot
from softdyn.derive.dominant_balance import definitions
from softdyn.derive.forms import force
from softdyn.derive.law import is_dry, is_rigid, ranges_of, typical_values, without_typical
from softdyn.derive.patience import nodes
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.regimes import SIGN, Crossover, Diagram, Regime, Side, directions_of, is_simple, sign_within
from softdyn.derive.soundness import tidy
from softdyn.derive.special import IN_NUMPY
from softdyn.derive.symbolic_powers import with_exponents
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
    found : bool or None
        Whether a film of this side and stability is among those found in numbers, at the law's typical parameters; None
        for an edge, or if the law gives none. A regime may be too narrow to be there.
    """

    closing: str
    opening: str
    side: Side
    stable: bool | None
    h_eq: Expr | None
    rate: Expr | None
    edge: Expr | None
    found: bool | None = None


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

    @property
    def side(self) -> Side:
        """Return the side of the plane that it lies on."""
        return "compression" if self.force[0] > 0 else "tension"


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
    branches : tuple of Branch, or None
        None if the law does not give typical values of all of its own parameters.
    """

    films: tuple[Film, ...]
    h_eq: Expr | None
    rate: Expr
    branches: tuple[Branch, ...] | None

    def without_form(self) -> tuple[Branch, ...]:
        """Return the branches found in numbers that no film in leading form stands for."""
        kinds = {(film.side, film.stable) for film in self.films}
        return tuple(branch for branch in self.branches or () if (branch.side, branch.stable) not in kinds)


def find_films(diagram: Diagram) -> Films | None:
    """Find the films of a law; None if it has no F_adh, or no fluid between its surfaces."""
    law = with_exponents(diagram.law, diagram.exponents)
    diagram = replace(diagram, law=law)
    if law.F_adh == 0 or is_dry(law):
        return None
    closed = inverted(law.F_adh, h, F) if not law.F_adh.has(a, delta) else None
    with knowing_ranges(ranges_of(law)):
        found = [_film(diagram, crossover, closed) for crossover in diagram.crossovers]
    films = tuple(film for film in found if film is not None)
    if without_typical(law):
        return Films(films, closed, relaxation_rate(law), None)
    numbers = branches(law)
    kinds = {(branch.side, branch.stable) for branch in numbers}
    # both lists are of the same law: where they differ, it is told
    films = tuple(f if f.stable is None else replace(f, found=(f.side, f.stable) in kinds) for f in films)
    return Films(films, closed, relaxation_rate(law), numbers)


def relaxation_rate(law: ContactLaw) -> Expr:
    """Return -(dF_adh/dh)/zeta along delta(h) at constant force, in a, h and delta."""
    along = tidy(diff(law.F_adh, h))
    if law.F_adh.has(a, delta):
        generic, known = d.generic_dynamics(law.general), definitions(law)
        remote = {d.F_adh_h: along, d.F_adh_a: tidy(diff(law.F_adh, a)), d.F_adh_delta: tidy(diff(law.F_adh, delta))}
        along = generic.remote_along.subs(d.C, generic.stiffness).subs({**remote, **known})
    return -along / law.zeta


def inverted(expr: Expr, symbol: Symbol, value: Expr) -> Expr | None:
    """Solve expr = value for a positive symbol; None if it occurs more than once, or what is done cannot be undone.

    Parameters
    ----------
    expr : Expr
    symbol : Symbol
    value : Expr
        Without the symbol.
    """
    found = _undone(*_in_one_exponential(expr, symbol, value), symbol)
    # sinh by its name is undone by its name
    return _undone(*_in_one_exponential(expr, symbol, value, quadratic=True), symbol) if found is None else found


def _undone(expr: Expr, value: Expr, symbol: Symbol) -> Expr | None:
    while expr != symbol:
        holding = [part for part in expr.args if part.has(symbol)]
        if len(holding) != 1:
            return None
        (inner,) = holding
        if isinstance(expr, Add):
            value = value - (expr - inner)
        elif isinstance(expr, Mul):
            value = value / (expr / inner)
        elif isinstance(expr, Pow) and inner == expr.base and is_simple(expr.exp):
            value = value ** (1 / expr.exp)
        elif isinstance(expr, exp):
            value = log(value)
        elif type(expr) in UNDONE:
            value = UNDONE[type(expr)](value)
        else:
            return None
        expr = inner
    return powsimp(value)


#: What undoes a function of a positive argument.
UNDONE = {log: exp, sinh: asinh, cosh: acosh, tanh: atanh, expm1: log1p, log1p: expm1}


def _in_one_exponential(expr: Expr, symbol: Symbol, value: Expr, quadratic: bool = False) -> tuple[Expr, Expr]:
    """Write expr = value as exp(symbol/length) = ..., where only one power of such an exponential is in it.

    Parameters
    ----------
    expr : Expr
    symbol : Symbol
    value : Expr
    quadratic : bool
        Whether there may be its square too, where one of the two roots is positive.
    """
    written = expr.rewrite(exp) if expr.has(tanh, coth, sinh, cosh, expm1) else expr
    exponents = list(dict.fromkeys(part.args[0] for part in sorted(written.atoms(exp), key=str) if part.has(symbol)))
    if not exponents or len(written.atoms(log)) or any(not (diff(one, symbol)).is_nonzero for one in exponents):
        return expr, value
    unit = min((abs_ for one in exponents if (abs_ := -one if one.could_extract_minus_sign() else one)), key=nodes)
    multiples = {one: simplify(one / unit) for one in exponents}
    smallest = min((abs(m) for m in multiples.values() if m.is_Rational), default=S.Zero)
    if smallest == 0 or not all(m.is_Rational and (m / smallest).is_Integer for m in multiples.values()):
        return expr, value
    y = Dummy("y", positive=True)
    inside = written.xreplace({exp(one): y ** (m / smallest) for one, m in multiples.items()})
    if inside.has(symbol):
        return expr, value
    top = fraction(together(inside - value))[0].as_poly(y)
    if top is None or (degree := int(top.degree())) == 0:
        return expr, value
    product = simplify(top.nth(0) / top.LC())
    if {power for (power,) in top.monoms()} == {0, degree}:
        return exp(degree * unit * smallest), -product
    if quadratic and degree == 2 and product.is_negative:  # as of 1/sinh in exponentials
        half = simplify(-top.nth(1) / (2 * top.LC()))
        return exp(unit * smallest), half + sqrt(half**2 - product)
    return expr, value


# -------------------------------------------------------------------------------------------------- between regimes


def _film(diagram: Diagram, crossover: Crossover, closed: Expr | None) -> Film | None:
    """Film on a crossover, if the gap closes on one side of it and opens on the other."""
    side = crossover.side
    one, other = (diagram.regime(name, side) for name in (crossover.first, crossover.second))
    rigid = is_rigid(diagram.law)
    if not all("dh_dt" in regime.forms and (rigid or regime.lambda1 is not None) for regime in (one, other)):
        return None
    signs = [
        sign_within(diagram.law, directions_of(diagram), regime.cones[0], regime.forms["dh_dt"].state)
        for regime in (one, other)
    ]
    if None in signs or signs[0] == signs[1]:
        return None
    closing, opening, inward = (one, other, 1) if signs[0] == -1 else (other, one, -1)
    # larger gaps at the same force: h = R eps^p and delta ~ h^lambda1 with a smaller p; delta of a rigid law is F/(E R)
    lambda1 = S.Zero if rigid else closing.lambda1
    assert lambda1 is not None
    upward = -inward * (crossover.facet[0] + crossover.facet[1] * lambda1)
    if upward == 0 and crossover.line.lhs == force and crossover.line.rhs.has(h):
        # the force of the film depends on the gap by a logarithm: it is stable where that falls
        face = _face(closing, crossover.facet)
        slope = diff(SIGN[side] * crossover.line.rhs, h)
        upward = 0 if face is None else -(sign_within(diagram.law, directions_of(diagram), face, slope) or 0)
    if upward == 0:
        edge = SIGN[side] * crossover.line.rhs if crossover.line.lhs == force else None
        return Film(closing.name, opening.name, side, None, None, None, edge)
    if closed is not None:
        h_eq = closed.subs(F, SIGN[side] * force)
    else:
        line = crossover.line
        exponential = crossover.quantity == ""  # the film lies there up to logarithms only
        h_eq = line.rhs if line.lhs == h else inverted(line.rhs, h, force)
        h_eq = None if exponential or line.rhs.has(log) else h_eq
    rate = _leading_rate(diagram, closing, crossover.facet)
    return Film(closing.name, opening.name, side, bool(upward > 0), h_eq, rate, None)


def _face(regime: Regime, facet: Normal) -> Cone | None:
    """The part of a facet that one of a regime's cones has."""
    faces = (tuple(ray for ray in cone if dot(facet, ray) == 0) for cone in regime.cones)
    return next((face for face in faces if len(face) == len(facet) - 1), None)


def _leading_rate(diagram: Diagram, closing: Regime, facet: Normal) -> Expr | None:
    """Leading form of the relaxation rate on the face between two regimes, in h = h_eq and F.

    Where one term of F_adh balances all that is left, F or the other terms, it is as large as these: the rate is
    -dln(F_adh)/dh times the rate at which the gap closes without it. Where two terms of F_adh balance each other, their
    slopes do not.
    """
    law = diagram.law
    face = _face(closing, facet)
    if law.F_adh.has(a, delta) or "zeta" not in closing.forms or face is None:
        return None
    directions = directions_of(diagram)
    scale = scale_of(face, directions, kept=1)
    try:
        remote, slope = (leading(expand(expr, scale))[1] for expr in (law.F_adh, diff(law.F_adh, h)))
    except UndecidedError:
        return None
    terms = remote.expand().args if remote.expand().is_Add else ()
    if {sign_within(law, directions, face, term) for term in terms} == {1, -1}:
        return powsimp(-slope / closing.forms["zeta"].leading)
    sign = sign_within(law, directions, face, remote)
    return None if sign is None else powsimp(-simplify(slope / remote) * sign * -closing.dh_dt)


# ------------------------------------------------------------------------------------------------------- in numbers

#: Gaps, in units of R, at which films are looked for.
GAPS = (1e-10, 1e2)
#: Gaps per decade, at first, and how often their intervals are halved where a branch begins or ends.
DENSITY = 40
DEEPEST = 30
#: Forces that no film is said to carry, in units of E R^2: an exponential never ends.
FAINTEST = 1e-20

#: A film: gap, force, relaxation rate.
Point = tuple[float, float, float]


@lru_cache(maxsize=16)
def branches(law: ContactLaw) -> tuple[Branch, ...]:
    """Films at the law's typical parameters, by branches; R = E = eta = 1.

    At each gap, the force that F_adh carries there is the film's; where it falls with the gap the film is stable.
    """
    numbers = {**dict.fromkeys(COMMON_PARAMETERS, S.One), **typical_values(law)}
    arguments = (a, h, delta)
    known = {s: e.subs(numbers) for s, e in definitions(law).items()}
    remote = lambdify(arguments, law.F_adh.subs(numbers), [IN_NUMPY, "math"])
    elastic = lambdify(arguments, known[F], [IN_NUMPY, "math"])
    radius = lambdify((h, delta), law.a.subs(numbers), [IN_NUMPY, "math"])
    rate = lambdify(arguments, relaxation_rate(law).subs(numbers), [IN_NUMPY, "math"])

    def at(gap: float) -> Point | None:
        try:
            deflection = (
                0.0
                if is_rigid(law)
                else _deflection(lambda x: elastic(radius(gap, x), gap, x) - remote(radius(gap, x), gap, x))
            )
            state = (radius(gap, deflection), gap, deflection)
            point = (gap, float(remote(*state)), float(rate(*state)))
        except (OverflowError, ZeroDivisionError, ValueError):
            return None
        return point if all(map(math.isfinite, point)) and abs(point[1]) >= FAINTEST else None

    count = round(DENSITY * math.log10(GAPS[1] / GAPS[0]))
    gaps = [GAPS[0] * (GAPS[1] / GAPS[0]) ** (i / count) for i in range(count + 1)]
    points = [at(gap) for gap in gaps]
    found = [points[0], *(point for i in range(count) for point in _between(at, *gaps[i : i + 2], *points[i : i + 2]))]
    return tuple(_branches([point for point in found if point is not None]))


def _between(
    at: Callable[[float], Point | None], low: float, high: float, one: Point | None, other: Point | None, depth: int = 0
) -> list[Point | None]:
    """Samples above one gap up to another, ever denser towards where films begin, or turn, or their force vanishes.

    A film pressed flat hardly thins as the force grows: its branch ends within a small range of gaps.
    """
    if depth == DEEPEST or (one is None and other is None) or (one and other and _kind(one) == _kind(other)):
        return [other]
    middle = math.sqrt(low * high)
    between = at(middle)
    return [
        *_between(at, low, middle, one, between, depth + 1),
        *_between(at, middle, high, between, other, depth + 1),
    ]


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
        if high == sign:
            raise ValueError("no deflection below R")
        low, high = high, sign * min(1.0, 2 * abs(high))
    for _ in range(60):
        middle = (low + high) / 2
        if (excess(middle) > 0) == (at_rest > 0):  # type: ignore[operator]
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _kind(film: Point) -> tuple[bool, bool]:
    """Whether a film is stable, and whether it is pressed."""
    return film[2] > 0, film[1] > 0


def _branches(points: Sequence[Point]) -> list[Branch]:
    """Cut a curve of films where its stability, or the sign of its force, changes."""
    runs: list[list[Point]] = []
    for point in points:
        if runs and _kind(runs[-1][-1]) == _kind(point):
            runs[-1].append(point)
        else:
            runs.append([point])
    return [
        Branch(run[0][2] > 0, *(tuple(values) for values in zip(*run, strict=True))) for run in runs if len(run) > 1
    ]
