"""Whether a regime is there, at real values of a law's parameters, and how far its leading forms are off.

Input: the regimes discovered of a law, and its typical values. Output: for each regime, whether its forms hold anywhere
within it, and the factor by which its conditions must hold for an error of 10 % and of 1 %.

A regime is where some ratios are small; at real values these may never be small enough, as where h << far and h >> ell
for far = 2 ell. The leading forms are compared with the law's own equations, solved in numbers, at the points of a grid
of gaps and forces that reaches beyond all crossovers: what is said is said of these points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Mul

from softdyn.derive.forms import force
from softdyn.derive.law import is_dry, without_typical
from softdyn.derive.regimes import Diagram, Regime, Side
from softdyn.derive.symbols import h
from softdyn.study.plane import Plane, margins, plane_of, states, vectorised

Array = NDArray[np.float64]

#: Forms that are compared with the law's equations; the energy's slope is an integral.
COMPARED = ("delta", "a", "zeta", "F_adh", "C", "D", "dh_dt", "dX_dt")
#: Points looked at: per decade of gap and of force, and how many decades beyond the window of the pictures.
DENSITY, BEYOND = 8, 3
#: Errors for which the factor is told, by which conditions must hold.
ERRORS = (0.1, 0.01)
#: A form is off by its own corrections; beyond this it is none.
MOST = 1.0


@dataclass(frozen=True)
class Presence:
    """Whether a regime is there.

    Attributes
    ----------
    there : bool
        Whether all forms hold somewhere in it, each off by less than its own size.
    reason : str
        Why it is absent; empty if it is there.
    off : float
        The largest error of a form where that is smallest; nan if no point lies in it.
    share : float
        Part of the points in it where a form is off by more than its own size.
    factors : mapping from float to (float or None)
        For errors: the factor by which all of the regime's conditions must hold, so that no form is off by more; None
        if they hold by that factor nowhere.
    shallow : frozenset of float
        For which of these delta << R must hold by that factor too.
    points : int
        Points that lie in it.
    """

    there: bool
    reason: str
    off: float
    share: float
    factors: Mapping[float, float | None]
    shallow: frozenset[float]
    points: int


#: Of a regime that nothing is known of.
ANYWHERE = Presence(True, "", math.nan, math.nan, {}, frozenset(), 0)
#: Presence of regimes, by side and name.
Presences = Mapping[tuple[Side, str], Presence]


def presence_of(diagram: Diagram) -> Presences:
    """Compare every regime within the model with the law's equations, at its typical values; nothing, without these."""
    law = diagram.law
    if without_typical(law) or is_dry(law):
        return {}
    shown = plane_of(diagram)
    X, Y = _grid(shown)
    found: dict[tuple[Side, str], Presence] = {}
    for side in ("compression", "tension"):
        here = [regime for regime in diagram.regimes if regime.side == side and regime.inside and regime.forms]
        if not here:
            continue
        exact = states(law, side, 10**X, shown.unit * 10**Y)
        for regime in here:
            found[side, regime.name] = _presence(regime, shown, exact, X, Y)
    return found


def errors_at(regime: Regime, plane: Plane, exact: Mapping[str, Array], X: Array, Y: Array) -> dict[str, Array]:
    """Return exact/leading - 1 of each form of a regime at points of the plane.

    Parameters
    ----------
    regime : Regime
    plane : Plane
    exact : mapping from str to array
        As of :func:`softdyn.study.plane.states`, at the points.
    X, Y : array, of one shape
        log10(h/R) and log10(kappa) of the points.
    """
    values = tuple(plane.values.items())
    errors = {}
    for name in COMPARED:
        form = regime.forms.get(name)
        if form is not None and name in exact:
            with np.errstate(all="ignore"):
                errors[name] = exact[name] / in_numbers(form.leading, values)(10**X, plane.unit * 10**Y) - 1
    return errors


def misfit(regime: Regime, plane: Plane, exact: Mapping[str, Array], X: Array, Y: Array) -> Array:
    """Return the largest error of a form at points of the plane; nan outside of the regime, and of the model.

    Parameters
    ----------
    regime : Regime
    plane : Plane
    exact : mapping from str to array
        As of :func:`softdyn.study.plane.states`, at the points.
    X, Y : array, of one shape
        log10(h/R) and log10(kappa) of the points.
    """
    sizes = _sizes(errors_at(regime, plane, exact, X, Y))
    worst = np.max(list(sizes.values()), axis=0) if sizes else np.zeros(X.shape)
    return np.where((margins(regime, plane, X, Y) >= 0) & np.isfinite(exact["delta"]), worst, np.nan)


def _sizes(errors: Mapping[str, Array]) -> dict[str, Array]:
    """Sizes of errors; what has no value in floating point says nothing."""
    return {name: np.nan_to_num(np.abs(error), nan=0.0, posinf=np.inf) for name, error in errors.items()}


def in_numbers(form: Expr, values: tuple[tuple[Any, float], ...]) -> Callable[[Array, Array], Array]:
    """Return a form as a function of h and F; a product of powers without a detour through code."""
    number = form.subs(dict(values)).evalf()
    factors = [factor.as_base_exp() for factor in Mul.make_args(number)]
    if all(base in (h, force) or base.is_number for base, _ in factors) and all(p.is_number for _, p in factors):
        c = float(Mul(*(base**p for base, p in factors if base.is_number)))
        powers = {base: float(p) for base, p in factors if not base.is_number}
        p, q = powers.get(h, 0.0), powers.get(force, 0.0)
        return lambda gap, load: c * gap**p * load**q
    function = vectorised((h, force), number)
    return lambda gap, load: np.broadcast_to(function(gap, load), np.broadcast(gap, load).shape).astype(float)


def _grid(plane: Plane) -> tuple[Array, Array]:
    """Points evenly spread over the window, and some decades beyond it."""

    def spread(low: float, high: float) -> Array:
        return np.linspace(low - BEYOND, high + BEYOND, round(DENSITY * (high - low + 2 * BEYOND)) + 1)

    X, Y = np.meshgrid(spread(*plane.xlim), spread(*plane.ylim))
    return X.ravel(), Y.ravel()


def _presence(regime: Regime, plane: Plane, exact: Mapping[str, Array], X: Array, Y: Array) -> Presence:
    margin = margins(regime, plane, X, Y)
    inside = (margin >= 0) & np.isfinite(exact["delta"])
    if not inside.any():
        return Presence(
            False,
            "its conditions hold together at none of the points looked at",
            math.nan,
            math.nan,
            dict.fromkeys(ERRORS),
            frozenset(),
            0,
        )
    errors = errors_at(regime, plane, {name: values[inside] for name, values in exact.items()}, X[inside], Y[inside])
    sizes = _sizes(errors)
    worst = np.max(list(sizes.values()), axis=0) if sizes else np.zeros(int(inside.sum()))
    best = int(np.argmin(worst))
    conditions = margins(regime, plane, X[inside], Y[inside], within_model=False)
    factors: dict[float, float | None] = {}
    shallow = set()
    for error in ERRORS:
        factors[error] = factor_needed(conditions, worst > error)
        if factors[error] is None and regime.edge is not None:
            factors[error] = factor_needed(margin[inside], worst > error)
            shallow |= {error} if factors[error] is not None else set()
    off = float(worst[best])
    reason = ""
    if off > MOST:
        name = max(sizes, key=lambda name: float(sizes[name][best]))
        ratio = float(errors[name][best]) + 1
        reason = f"where it is best {name} is {ratio:.2g} times its leading form"
    share = float(np.mean(worst > MOST))
    return Presence(off <= MOST, reason, off, share, factors, frozenset(shallow), int(inside.sum()))


def factor_needed(margin: Array, beyond: NDArray[np.bool_]) -> float | None:
    """The factor by which conditions must hold, so that no point is beyond an error; None if none holds by that."""
    needed = float(margin[beyond].max()) if beyond.any() else 0.0
    return 10**needed if not beyond.any() or (margin > needed).any() else None
