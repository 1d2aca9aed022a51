"""A closure's plane of Re and volume fraction in numbers: where its regimes are, and how far their forms are off.

Input: the regimes discovered of a closure. Output: arrays over points of the plane. eta = r = 1, a closure's own
parameters have their typical values, and fractions are those that spheres can have: phi up to 0.74, that of a
crystal, or to the closure's own densest packing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, S, lambdify

from softdyn.derive.closure import (
    Closure,
    Re,
    c,
    densest,
    drag,
    eta,
    in_fractions,
    permeability,
    phi,
    r,
    result_of,
    sample_values,
    viscosity,
)
from softdyn.derive.closure_regimes import ClosureDiagram, ClosureRegime
from softdyn.derive.sphere import drag_of_sphere
from softdyn.study.presence import ERRORS, MOST, Presence, factor_needed

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Spheres pack no denser than this: pi/sqrt(18).
CRYSTAL = math.pi / math.sqrt(18)
#: Decades of Re that are shown, and points along each side.
DECADES = (-4.0, 8.0)
POINTS = 241
#: How near the ends of the fractions points lie.
NEAR = 1e-3

Presences = Mapping[str, Presence]


def fractions_of(closure: Closure) -> tuple[float, float]:
    """Smallest and largest volume fraction of the grains that is looked at."""
    limit = float(densest(closure).subs(sample_values(closure)))
    return NEAR, min(CRYSTAL, limit * (1 - NEAR))


def points(closure: Closure, count: int = POINTS) -> tuple[Array, Array]:
    """Re and phi at the points of a grid."""
    numbers = np.logspace(*DECADES, count)
    return tuple(np.meshgrid(numbers, np.linspace(*fractions_of(closure), count)))  # type: ignore[return-value]


def unit_of(closure: Closure) -> Expr:
    """What a closure is told in units of: the drag of a sphere alone, the fluid's viscosity, r^2; or 1."""
    return {drag: drag_of_sphere(r), viscosity: eta, permeability: r**2}.get(result_of(closure), S.One)


def in_numbers(closure: Closure, expr: Any) -> Any:
    """An expression, or a condition, as a function of arrays of Re and phi."""
    fixed = {symbol: value for symbol, value in sample_values(closure).items() if symbol not in (Re, c, phi)}
    written = expr.subs({c: 1 - phi}) if not isinstance(expr, Expr) else in_fractions(closure, expr, phi)
    function = lambdify([Re, phi], written.subs(fixed), modules="numpy")

    def at(numbers: Array, grains: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.broadcast_to(function(numbers, grains), np.broadcast(numbers, grains).shape)

    return at


def margins(closure: Closure, regime: ClosureRegime, numbers: Array, grains: Array) -> Array:
    """Decades by which a regime's conditions hold; -inf where its case does not apply, inf without conditions.

    Parameters
    ----------
    closure : Closure
    regime : ClosureRegime
    numbers, grains : array, of one shape
        Re, and volume fractions of the grains.
    """
    inside = in_numbers(closure, regime.case)(numbers, grains).astype(bool)
    least = np.full(numbers.shape, math.inf)
    for condition in regime.conditions:
        ratio = in_numbers(closure, condition.ratio)(numbers, grains)
        with np.errstate(all="ignore"):
            least = np.minimum(least, -np.log10(ratio))
    return np.where(inside, least, -math.inf)


def errors_of(closure: Closure, regime: ClosureRegime, numbers: Array, grains: Array) -> Array:
    """Return abs(closure/form - 1).

    Parameters
    ----------
    closure : Closure
    regime : ClosureRegime
        One with a form.
    numbers, grains : array, of one shape
        Re, and volume fractions of the grains.
    """
    assert regime.form is not None
    exact = in_numbers(closure, closure.expression)(numbers, grains)
    with np.errstate(all="ignore"):
        return np.asarray(np.abs(exact / in_numbers(closure, regime.form.state)(numbers, grains) - 1))


def presence_of_closure(diagram: ClosureDiagram) -> Presences:
    """How far each regime's form is off, at the points of a grid."""
    closure = diagram.closure
    numbers, grains = points(closure)
    return {
        regime.name: _presence(closure, regime, numbers, grains)
        for regime in diagram.regimes
        if regime.form is not None and not regime.exact
    }


def _presence(closure: Closure, regime: ClosureRegime, numbers: Array, grains: Array) -> Presence:
    margin = margins(closure, regime, numbers, grains)
    inside = margin >= 0
    if not inside.any():
        reason = "its conditions hold together at none of the points looked at"
        return Presence(False, reason, math.nan, math.nan, dict.fromkeys(ERRORS), frozenset(), 0)
    off = errors_of(closure, regime, numbers, grains)[inside]
    best = float(off.min())
    factors = {error: factor_needed(margin[inside], off > error) for error in ERRORS}
    reason = "" if best <= MOST else f"where it is best it is off by {100 * best:.2g} %"
    return Presence(best <= MOST, reason, best, float(np.mean(off > MOST)), factors, frozenset(), int(inside.sum()))
