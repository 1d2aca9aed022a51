"""A law's plane of gap and force in numbers: where its regimes are, and what its equations give there.

Input: the regimes discovered of a law. Output: polygons and lines in log10(h/R) and log10(kappa), kappa = F/unit, and
the exact deflection, gap rate and local exponents at any gap and force. R = E = eta = 1, and the law's own parameters
have their typical values. Everything is for sizes: F and delta stand for abs(F) and abs(delta), in tension too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sympy import (
    Abs,
    Expr,
    Max,
    Min,
    Piecewise,
    S,
    Symbol,
    acos,
    acosh,
    asin,
    asinh,
    atan,
    atanh,
    cos,
    cosh,
    diff,
    exp,
    lambdify,
    log,
    sign,
    sin,
    sinh,
    tan,
    tanh,
)
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.function import Application

from softdyn.derive import dynamics as d
from softdyn.derive.cones import cut, dot, primitive
from softdyn.derive.dimensions import FORCE, LENGTH
from softdyn.derive.equations import with_known
from softdyn.derive.forms import as_product, force, force_unit, kappa, x
from softdyn.derive.law import is_rigid, typical_values, without_typical
from softdyn.derive.regimes import SIGN, Crossover, Diagram, Regime, Side
from softdyn.derive.soundness import tidy
from softdyn.derive.special import IN_NUMPY
from softdyn.derive.symbols import COMMON_PARAMETERS, F, R, a, delta, h
from softdyn.errors import SceneError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw
    from softdyn.study.values import RealValues

Array = NDArray[np.float64]
Interval = tuple[float, float]
#: log10 of a positive quantity, as a function of log10(h/R) and log10(kappa).
Logarithm = Callable[[Any, Any], Any]

#: Points along a boundary of a regime that may be curved.
FINE = 400
#: Decades shown beyond the lines and points where regimes meet, and at least.
MARGIN = 2.0
LEAST = (-4.0, 2.0)
MOST_DECADES = 14.0
#: Forces that curves are drawn for, about.
MOST_CURVES = 7


@dataclass(frozen=True)
class Plane:
    """A law's plane of gap and force, and the window of it that is looked at.

    Attributes
    ----------
    law : ContactLaw
    values : mapping from Symbol to float
        Of all parameters, in units of R, E and eta.
    unit : float
        The force that kappa = 1 stands for.
    xlim, ylim : (low, high)
        Of log10(h/R) and log10(kappa).
    real : RealValues or None
        The law's values in SI units, if they are known.
    """

    law: ContactLaw
    values: Mapping[Symbol, float]
    unit: float
    xlim: Interval
    ylim: Interval
    real: RealValues | None = None

    @property
    def shift(self) -> tuple[float, float]:
        """What is added to the plane's coordinates to have log10 of a gap in m and a force in N; 0 if unknown."""
        if self.real is None:
            return 0.0, 0.0
        return math.log10(self.real.unit(LENGTH)), math.log10(self.real.unit(FORCE) * self.unit)


def plane_of(diagram: Diagram, real: RealValues | None = None) -> Plane:
    """Return the plane of a law, with a window that holds the points where its regimes meet, and the model's edge.

    Parameters
    ----------
    diagram : Diagram
    real : RealValues, optional
        Of the diagram's law.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    values = parameter_values(diagram.law)
    unit = float(force_unit(diagram.law).subs(values))
    whole = Plane(diagram.law, values, unit, LEAST, (-300.0, 300.0))
    crossovers = [crossover for crossover in diagram.crossovers if _within_model(diagram, crossover)]
    upright = [float(logarithm(c.line.rhs, whole)(0, 0)) for c in crossovers if c.line.lhs == h]
    at = [(logarithm(p.h, whole)(0, 0), logarithm(p.force, whole)(0, 0) - math.log10(unit)) for p in diagram.points]
    gaps = [*upright, *(float(gap) for gap, _ in at)]
    xlim = (min([LEAST[0], *(gap - MARGIN for gap in gaps)]), max([LEAST[1], *(gap + MARGIN for gap in gaps)]))
    xlim = (math.floor(xlim[0] + 1e-9), math.ceil(xlim[1] - 1e-9))
    edge = largest_forces(diagram.law, 10 ** np.linspace(*xlim, FINE)) / unit
    edge = edge[np.isfinite(edge)]
    slanted = [logarithm(c.line.rhs, whole)(xlim[0], 0) - math.log10(unit) for c in crossovers if c.line.lhs == force]
    low = [float(y) - 0.4 for y in slanted] + [float(y) - MARGIN for _, y in at]
    # a rigid law has no edge: all forces are shown that something happens at
    high = [float(y) + MARGIN for _, y in at if math.isfinite(y)]
    top = math.log10(float(np.max(edge))) + 0.6 if len(edge) else max([0.6, *high])
    lowest = min((y for y in low if math.isfinite(y)), default=top - 6)
    return Plane(diagram.law, values, unit, xlim, (max(min(lowest, top - 6), top - MOST_DECADES), top), real)


def _within_model(diagram: Diagram, crossover: Crossover) -> bool:
    return any(diagram.regime(name, crossover.side).inside for name in (crossover.first, crossover.second))


def parameter_values(law: ContactLaw) -> dict[Symbol, float]:
    """Return the values of all parameters, in units of R, E and eta.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own.
    """
    typical = typical_values(law)
    missing = without_typical(law)
    if missing:
        names = ", ".join(map(str, missing))
        raise SceneError(
            f"law {law.name!r} gives no typical value of {names}, for which its regimes could be drawn or measured; "
            f"declare it in units of R, E and eta: ContactLaw(..., typical={{{missing[0]}: ...}})"
        )
    return {**dict.fromkeys(COMMON_PARAMETERS, 1.0), **{symbol: float(value) for symbol, value in typical.items()}}


def sides_of(diagram: Diagram) -> tuple[Side, ...]:
    """Sides with regimes of their own: compression alone, if tension mirrors it, or the law is of pressed surfaces."""
    pulled = _seen(diagram, "tension")
    return ("compression", "tension") if pulled and pulled != _seen(diagram, "compression") else ("compression",)


def _seen(diagram: Diagram, side: Side) -> set[Any]:
    """What is drawn of the regimes of one side; the rate with the sign of its effect, closing or opening the gap."""
    found = set()
    for regime in diagram.regimes:
        if regime.side == side:
            rate = regime.forms["dh_dt"].leading * SIGN[side] if "dh_dt" in regime.forms else None
            deflection = regime.forms["delta"].leading if "delta" in regime.forms else None
            found.add((frozenset(regime.conditions), regime.inside, deflection, rate))
    return found


def shown_forces(diagram: Diagram, plane: Plane) -> Array:
    """Forces, over the unit, that curves are drawn for: powers of ten within the window, below the model's edge.

    Powers of ten of the force itself, where it is known in N.
    """
    shift = plane.shift[1]
    edges = [Y.max() for side in sides_of(diagram) for line, X, Y in boundaries(diagram, side, plane) if line is None]
    first = math.ceil(plane.ylim[0] + shift + 0.1)
    last = math.floor(max(edges, default=plane.ylim[1]) + shift - 0.1)
    step = max(1, math.ceil((last - first) / MOST_CURVES))
    return 10.0 ** (np.arange(last, first - 1, -step, dtype=float)[::-1] - shift)


# -------------------------------------------------------------------------------------------------------------- forms


def monomial(form: Expr, unit: Expr) -> tuple[Expr, Expr, Expr]:
    """Return a dimensionless form as a number and the powers of h/R and of kappa = F/unit.

    Raises
    ------
    ValueError
        If it is not a product of such powers.
    """
    product = as_product(form, unit)
    if product is None or set(product.powers) - {x, kappa}:
        raise ValueError(f"{form} is not a product of powers of h/R and kappa")
    return product.number, product.powers.get(x, S.Zero), product.powers.get(kappa, S.Zero)


def logarithm(form: Expr, plane: Plane) -> Logarithm:
    """Return log10 of the size of a form in h, F and the parameters, as a function of log10(h/R) and log10(kappa)."""
    return _logarithm(form, tuple(plane.values.items()), plane.unit)


@lru_cache(maxsize=1000)
def _logarithm(form: Expr, values: tuple[tuple[Symbol, float], ...], unit: float) -> Logarithm:
    known = dict(values)
    factors = [factor.as_base_exp() for factor in form.expand(power_base=True).as_ordered_factors()]
    if all(power.is_number and (base.is_Symbol or base.is_number) for base, power in factors):
        numbers = [(known.get(base, base), power) for base, power in factors if base not in (h, force)]
        c = sum(float(power) * math.log10(abs(float(base))) for base, power in numbers)
        p = sum(float(power) for base, power in factors if base == h)
        q = sum(float(power) for base, power in factors if base == force)
        return lambda X, Y: c + p * X + q * (Y + math.log10(unit))
    function = _function(form, values)

    def of_any(X: Any, Y: Any) -> Any:
        with np.errstate(all="ignore"):
            value = np.log10(np.abs(function(10.0 ** np.asarray(X, float), unit * 10.0 ** np.asarray(Y, float))))
        return np.broadcast_to(value, np.broadcast_shapes(np.shape(X), np.shape(Y)))

    return of_any


def evaluate(form: Expr, plane: Plane, X: Array, Y: Array) -> Array:
    """Value of a form at points of the plane, R = E = eta = 1.

    Parameters
    ----------
    form : Expr
        In h, F and the parameters.
    plane : Plane
    X, Y : array
        log10(h/R) and log10(kappa) of the points; they broadcast.
    """
    function = _function(form, tuple(plane.values.items()))
    with np.errstate(all="ignore"):
        return np.broadcast_to(function(10.0**X, plane.unit * 10.0**Y), np.broadcast(X, Y).shape).astype(float)


@lru_cache(maxsize=1000)
def _function(form: Expr, values: tuple[tuple[Symbol, float], ...]) -> Callable[..., Any]:
    return vectorised((h, force), form.subs(dict(values)))


def ordering(regime: Regime) -> tuple[Expr, ...] | None:
    """Return h, delta and R from the smallest to the largest; None if their order differs within the regime."""
    axes = len(regime.cones[0][0])
    exponents: dict[Expr, tuple[int, ...]] = {h: (1, 0, 0)[:axes], delta: (0, 1, 0)[:axes], R: (0,) * axes}
    rays = [ray for cone in cut(regime.cones, [(0, 1, 0)[:axes]]) for ray in cone]
    if not rays:
        return None
    inner = primitive([sum(parts) for parts in zip(*rays, strict=True)])
    ordered = sorted(exponents, key=lambda length: -dot(exponents[length], inner))
    apart = all(dot(exponents[one], ray) >= dot(exponents[two], ray) for one, two in pairwise(ordered) for ray in rays)
    return tuple(ordered) if apart else None


def length_ratios(regime: Regime) -> list[Expr]:
    """Return each length of a regime's ordering over the next larger one, in h and F: below 1 inside."""
    lengths = [regime.delta if length == delta else length for length in ordering(regime) or ()]
    return [one / two for one, two in pairwise(lengths)]


# ------------------------------------------------------------------------------------------------------------ regions


@dataclass(frozen=True)
class _Bounds:
    """Where a regime is: between two gaps, above some curves and below others."""

    low: float
    high: float
    floors: tuple[Logarithm, ...]
    ceilings: tuple[Logarithm, ...]

    def holds(self, X: Array, Y: Array) -> NDArray[np.bool_]:
        """Whether points are in it; those on its boundary are."""
        close = 1e-9
        inside = (self.low - close <= X) & (self.high + close >= X)
        for floor in self.floors:
            inside &= floor(X, 0) - close <= Y
        for ceiling in self.ceilings:
            inside &= ceiling(X, 0) + close >= Y
        return inside


def _bounds(regime: Regime, plane: Plane, within_model: bool) -> _Bounds:
    low, high = plane.xlim
    floors, ceilings = [], []

    def curve(form: Expr) -> Logarithm:
        log = logarithm(form, plane)
        return lambda X, Y: log(X, 0.0) - math.log10(plane.unit)

    for condition in regime.conditions:
        if condition.small == force:
            ceilings.append(curve(condition.large))
        elif condition.large == force:
            floors.append(curve(condition.small))
        elif condition.small == h:
            high = min(high, float(logarithm(condition.large, plane)(0, 0)))
        else:
            low = max(low, float(logarithm(condition.small, plane)(0, 0)))
    if within_model and regime.edge is not None:
        ceilings.append(curve(regime.edge))
    return _Bounds(low, high, tuple(floors), tuple(ceilings))


def region(regime: Regime, plane: Plane, within_model: bool = True) -> list[Array]:
    """Polygons of a regime in the window, of shape (corners, 2): log10(h/R) and log10(kappa).

    Parameters
    ----------
    within_model : bool
        Leave out what lies beyond delta = R.
    """
    if not regime.forms or (within_model and not regime.inside):
        return []
    bounds = _bounds(regime, plane, within_model)
    if not bounds.low < bounds.high:
        return []
    curves = (*bounds.floors, *bounds.ceilings, _level(plane.ylim[0]), _level(plane.ylim[1]))
    X = _with_crossings(np.linspace(bounds.low, bounds.high, FINE + 1), curves)
    lower = np.max([floor(X, 0) for floor in (*bounds.floors, _level(plane.ylim[0]))], axis=0)
    upper = np.min([ceiling(X, 0) for ceiling in (*bounds.ceilings, _level(plane.ylim[1]))], axis=0)
    polygons = []
    for run in _runs(upper >= lower - 1e-9):
        corners = np.concatenate([np.c_[X[run], lower[run]], np.c_[X[run], upper[run]][::-1]])
        if np.max(upper[run] - lower[run]) > 1e-6:
            polygons.append(_simplified(corners))
    return polygons


def holds(regime: Regime, plane: Plane, X: Array, Y: Array) -> NDArray[np.bool_]:
    """Whether points of the window are in a regime, within the model.

    Parameters
    ----------
    regime : Regime
    plane : Plane
    X, Y : array, of one shape
        log10(h/R) and log10(kappa) of the points.
    """
    return _bounds(regime, plane, True).holds(X, Y)


def margins(regime: Regime, plane: Plane, X: Array, Y: Array, within_model: bool = True) -> Array:
    """By how many decades the regime's conditions hold at points; < 0 where not.

    Parameters
    ----------
    regime : Regime
    plane : Plane
    X, Y : array, of one shape
        log10(h/R) and log10(kappa) of the points.
    within_model : bool
        Whether delta < R is one of the conditions.
    """
    bounds = _bounds(regime, plane, within_model)
    found = np.full(np.broadcast(X, Y).shape, np.inf)
    # a window's edge is no condition
    if bounds.low > plane.xlim[0]:
        found = np.minimum(found, X - bounds.low)
    if bounds.high < plane.xlim[1]:
        found = np.minimum(found, bounds.high - X)
    with np.errstate(all="ignore"):
        for floor in bounds.floors:
            found = np.minimum(found, np.nan_to_num(Y - floor(X, 0), nan=-np.inf))
        for ceiling in bounds.ceilings:
            found = np.minimum(found, np.nan_to_num(ceiling(X, 0) - Y, nan=-np.inf))
    return found


def line_points(crossover: Crossover, diagram: Diagram, plane: Plane) -> tuple[Array, Array]:
    """Where a crossover bounds its regimes, within the model and the window: log10(h/R) and log10(kappa).

    Parameters
    ----------
    crossover : Crossover
    diagram : Diagram
        With its regimes.
    plane : Plane
    """
    regimes = [diagram.regime(name, crossover.side) for name in (crossover.first, crossover.second)]
    bounds = [_bounds(regime, plane, regime.inside) for regime in regimes]
    if not any(regime.inside for regime in regimes):
        return np.empty(0), np.empty(0)
    form = logarithm(crossover.line.rhs, plane)
    if crossover.line.lhs == h:
        gap = float(form(0, 0))
        turning = [float(c(gap, 0)) for one in bounds for c in (*one.floors, *one.ceilings)]
        Y = np.unique([*np.linspace(*plane.ylim, FINE + 1), *(y for y in turning if math.isfinite(y))])
        X = np.full(len(Y), gap)
    else:
        X, Y = _along(form, bounds, plane)
    return _kept(X, Y, bounds, plane)


def edge_points(regime: Regime, plane: Plane) -> tuple[Array, Array]:
    """Where a regime ends with the model, at delta = R of its leading form: log10(h/R) and log10(kappa)."""
    if regime.edge is None:
        return np.empty(0), np.empty(0)
    bounds = [_bounds(regime, plane, True)]
    return _kept(*_along(logarithm(regime.edge, plane), bounds, plane), bounds, plane)


def boundaries(diagram: Diagram, side: Side, plane: Plane) -> Iterator[tuple[Crossover | None, Array, Array]]:
    """Lines between the regimes of one side, with their points; those where the model ends, without a crossover.

    Parameters
    ----------
    diagram : Diagram
    side : "compression" or "tension"
    plane : Plane

    Yields
    ------
    crossover : Crossover or None
        None where the model ends.
    X, Y : array, shape (points,)
        log10(h/R) and log10(kappa) along the line.
    """
    for crossover in diagram.crossovers:
        if crossover.side == side:
            X, Y = line_points(crossover, diagram, plane)
            if len(X):
                names = (crossover.first, crossover.second)
                within = all(diagram.regime(name, side).inside for name in names)
                yield (crossover if within else None), X, Y
    for regime in diagram.regimes:
        if regime.side == side:
            X, Y = edge_points(regime, plane)
            if len(X):
                yield None, X, Y


def _along(form: Logarithm, bounds: Sequence[_Bounds], plane: Plane) -> tuple[Array, Array]:
    def curve(X: Any, Y: Any) -> Any:
        return form(X, 0.0) - math.log10(plane.unit)

    low, high = max(one.low for one in bounds), min(one.high for one in bounds)
    if not low < high:
        return np.empty(0), np.empty(0)
    others = [c for one in bounds for c in (*one.floors, *one.ceilings)]
    X = _with_crossings(
        np.linspace(low, high, FINE + 1), (curve, *others, _level(plane.ylim[0]), _level(plane.ylim[1]))
    )
    return X, np.broadcast_to(curve(X, 0), X.shape)


def _kept(X: Array, Y: Array, bounds: Sequence[_Bounds], plane: Plane) -> tuple[Array, Array]:
    """Longest piece of a line that lies in the window and on the boundary of the regimes."""
    if not len(X):
        return X, Y
    inside = (plane.ylim[0] - 1e-9 <= Y) & (plane.ylim[1] + 1e-9 >= Y)
    inside &= (plane.xlim[0] - 1e-9 <= X) & (plane.xlim[1] + 1e-9 >= X)
    for one in bounds:
        inside &= one.holds(X, Y)
    run = max(_runs(inside), key=len, default=np.empty(0, int))
    return X[run], Y[run]


def _level(y: float) -> Logarithm:
    return lambda X, Y: np.full(np.shape(X), y)


def _with_crossings(X: Array, curves: Sequence[Logarithm]) -> Array:
    """Add the places where curves cross each other: exactly, where they are straight."""
    values = [np.broadcast_to(curve(X, 0), X.shape) for curve in curves]
    found = [X]
    for one, other in combinations(values, 2):
        with np.errstate(invalid="ignore"):
            apart = one - other
        at = np.flatnonzero(apart[:-1] * apart[1:] < 0)
        found.append(X[at] + (X[at + 1] - X[at]) * apart[at] / (apart[at] - apart[at + 1]))
    return np.unique(np.concatenate(found))


def _runs(inside: NDArray[np.bool_]) -> Iterator[NDArray[np.int_]]:
    """Indices of each run of what is inside, of two points at least."""
    at = np.flatnonzero(inside)
    for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
        if len(run) > 1:
            yield run


def _simplified(corners: Array) -> Array:
    """Leave out the corners of a polygon that lie on a straight line between their neighbours."""
    while True:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        along, onward = corners - before, after - before
        turn = np.abs(along[:, 0] * onward[:, 1] - along[:, 1] * onward[:, 0])
        straight = turn <= 1e-9 * (1e-3 + np.hypot(*onward.T))
        # two neighbours at once could hide a corner between them
        straight[1:] &= ~straight[:-1]
        if not straight.any() or len(corners) - straight.sum() < 3:
            return corners
        corners = corners[~straight]


# ------------------------------------------------------------------------------------------------------- exact states


#: Halvings of 90 in ln delta, to the last bit.
BISECTIONS = 64
#: Functions that numpy has; others, as erfc and Bessel's, are scipy's.
OF_NUMPY = (
    Abs, Max, Min, Piecewise, acos, acosh, asin, asinh, atan, atanh, cos, cosh, exp, expm1, log, log1p, sign, sin, sinh,
    tan, tanh,
)  # fmt: skip


def vectorised(arguments: Sequence[Symbol], what: Expr | list[Expr]) -> Callable[..., Any]:
    """Return one or several expressions as a function of arrays."""
    parts = what if isinstance(what, list) else [what]
    plain = all(isinstance(one, OF_NUMPY) for part in parts for one in part.atoms(Application))
    # by its name, sympy would load all that numpy has, down to its compiler of Fortran
    modules: list[Any] = [IN_NUMPY, np] if plain else [IN_NUMPY, "scipy", np]
    function: Callable[..., Any] = lambdify(arguments, what, modules)
    return function


@lru_cache(maxsize=64)
def _equation(law: ContactLaw, name: str) -> Callable[..., Any]:
    """One of the law's equations in numbers.

    Parameters
    ----------
    law : ContactLaw
    name : str
        ``radius`` of (h, delta), ``elastic`` of (a, delta, h), ``partials`` of (a, h, delta), and what follows from
        these: ``stiffness``, ``friction``, ``dh_dt`` and ``exponents`` of a state.
    """
    if name == "radius":
        return vectorised((h, delta), _in_numbers(law, law.a))
    if name == "elastic":
        return vectorised((a, delta, h), _in_numbers(law, law.F_ela))
    if name == "partials":
        return vectorised((a, h, delta), [_in_numbers(law, expr) for expr in _partials(law).values()])
    generic = d.generic_dynamics(law.general)
    forms: dict[str, tuple[tuple[Symbol, ...], Expr | list[Expr]]] = {
        "stiffness": ((), generic.stiffness),
        "friction": ((d.C,), generic.friction),
        "dh_dt": ((F,), generic.dh_dt),
        "exponents": ((h, delta, F, d.C, d.dh_dt), [generic.lambda1, generic.lambda2]),
    }
    given, form = forms[name]
    return vectorised((*given, *_partials(law)), form)


def _in_numbers(law: ContactLaw, expr: Expr) -> Expr:
    # a kink leaves a derivative of sign(delta) behind, which is a number for no array
    return with_known(tidy(S(expr)), parameter_values(law))


@lru_cache(maxsize=16)
def _of_floats(law: ContactLaw) -> tuple[Callable[..., float], Callable[..., float]] | None:
    """Radius and elastic force in numbers, of one gap and one deflection; None where Python has no such functions."""
    parts = _in_numbers(law, law.a), _in_numbers(law, law.F_ela)
    if not all(isinstance(one, OF_NUMPY) for part in parts for one in part.atoms(Application)):
        return None
    return lambdify((h, delta), parts[0], "math"), lambdify((a, delta, h), parts[1], "math")


def _partials(law: ContactLaw) -> dict[Symbol, Expr]:
    """The forces and the friction, and the slopes that a state follows from."""
    return {
        d.F_ela: law.F_ela, d.F_adh: law.F_adh, d.zeta: law.zeta,
        d.a_h: diff(law.a, h), d.a_delta: diff(law.a, delta),
        d.F_a: diff(law.F_ela, a), d.F_delta: diff(law.F_ela, delta), d.F_h: diff(law.F_ela, h),
        d.zeta_a: diff(law.zeta, a), d.zeta_h: diff(law.zeta, h),
        d.F_adh_a: diff(law.F_adh, a), d.F_adh_h: diff(law.F_adh, h), d.F_adh_delta: diff(law.F_adh, delta),
    }  # fmt: skip


def largest_forces(law: ContactLaw, gaps: Array, side: Side = "compression") -> Array:
    """Size of the force that makes delta = R, the edge of the model, at each gap, in units of E R^2.

    Parameters
    ----------
    law : ContactLaw
    gaps : array
        In units of R.
    side : "compression" or "tension"
    """
    radius, elastic, sign = _equation(law, "radius"), _equation(law, "elastic"), SIGN[side]
    with np.errstate(all="ignore"):
        return np.broadcast_to(np.abs(elastic(radius(gaps, sign), sign, gaps)), gaps.shape)


def deflections(law: ContactLaw, side: Side, gaps: Array, forces: Array) -> Array:
    """Size of delta at which F_ela = F, in units of R, by bisection of ln delta; nan where it is beyond R.

    Parameters
    ----------
    law : ContactLaw
    side : "compression" or "tension"
    gaps, forces : arrays that broadcast
        In units of R and of E R^2; forces are sizes.
    """
    radius, elastic, sign = _equation(law, "radius"), _equation(law, "elastic"), SIGN[side]
    gaps, forces = np.broadcast_arrays(np.asarray(gaps, float), np.asarray(forces, float))
    low, high = np.full(gaps.shape, -90.0), np.zeros(gaps.shape)
    with np.errstate(all="ignore"):
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            deflection = sign * np.exp(middle)
            below = np.abs(elastic(radius(gaps, deflection), deflection, gaps)) < forces
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        beyond = ~(largest_forces(law, gaps, side) >= forces)
    return np.where(beyond, np.nan, np.exp((low + high) / 2))


def deflection_at(law: ContactLaw, side: Side, gap: float, load: float) -> float:
    """The same at one gap and one force, for whoever asks step by step: an array of one takes a hundred times as long.

    Parameters
    ----------
    law : ContactLaw
    side : "compression" or "tension"
    gap, load : float
        In units of R and of E R^2.
    """
    functions, sign = _of_floats(law), SIGN[side]
    with suppress(ArithmeticError, ValueError, TypeError):  # where arrays have no number, or no end
        if functions is not None:
            radius, elastic = functions
            low, high = -90.0, 0.0
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                deflection = sign * math.exp(middle)
                below = math.fabs(elastic(radius(gap, deflection), deflection, gap)) < load
                low, high = (middle, high) if below else (low, middle)
            beyond = not math.fabs(elastic(radius(gap, sign), sign, gap)) >= load
            return math.nan if beyond else math.exp((low + high) / 2)
    return float(deflections(law, side, np.array(gap), np.array(load)))


def states(law: ContactLaw, side: Side, gaps: Array, forces: Array) -> dict[str, Array]:
    """Exact states at given gaps and forces.

    Parameters
    ----------
    gaps, forces : arrays that broadcast
        In units of R, E and eta; forces are sizes.

    Returns
    -------
    dict of arrays
        ``delta`` (its size), ``lambda1``, ``lambda2``, and those of :data:`softdyn.derive.regimes.FORMS` but U_h, dX_dt
        at constant force; nan where the deflection is beyond R.
    """
    sign = SIGN[side]
    gaps, forces = np.broadcast_arrays(np.asarray(gaps, float), np.asarray(forces, float))
    rigid = is_rigid(law)
    found = deflections(law, side, gaps, forces)
    deflection = sign * found * (not rigid)
    with np.errstate(all="ignore"):
        radius = _equation(law, "radius")(gaps, deflection)
        partials = _equation(law, "partials")(radius, gaps, deflection)
        rate = _equation(law, "dh_dt")(sign * forces, *partials)
        # a rigid law has no delta, and its F_a = 0 leaves any stiffness out
        stiffness = 1.0 if rigid else _equation(law, "stiffness")(*partials)
        lambda1, lambda2 = _equation(law, "exponents")(gaps, deflection, sign * forces, stiffness, rate, *partials)
        friction = partials[2] if rigid else _equation(law, "friction")(stiffness, *partials)
        centres = -(sign * forces - partials[1]) / friction
    named = {
        "a": radius, "zeta": partials[2], "F_adh": partials[1], "C": stiffness, "D": friction, "dh_dt": rate,
        "dX_dt": centres, "lambda1": lambda1, "lambda2": lambda2,
    }  # fmt: skip
    if rigid:
        found, lambda1 = np.zeros(gaps.shape), np.nan
    solved = np.isfinite(found)
    return {"delta": found, **{name: np.where(solved, value, np.nan) for name, value in named.items()}}
