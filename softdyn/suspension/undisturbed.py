"""The drag on grains at the velocity that the fluid would have without them; see :mod:`softdyn.derive.own_flow`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from softdyn.derive import closure as arguments
from softdyn.derive import own_flow
from softdyn.derive.closure import Closure
from softdyn.errors import IntegrationError

Array = NDArray[np.float64]

#: Points of quadrature over wave numbers, and of the table over Reynolds numbers, which is of 1e-5 of its values.
POINTS, TABLE = 200, np.logspace(-6, 8, 561)
#: Ratio of R to the wave number below which directions are summed over, and how many.
SMALL, FEW = 0.5, 16
#: Volume fraction that closures are told at least: some divide by it.
LEAST_PHI = 1e-12
#: Repetitions for the speed that the drag itself depends on, until it changes by less than this.
MOST, GOOD = 60, 1e-12
#: Fractions at which the viscosity of a mixture is looked at.
FRACTIONS = 101
#: Of the velocity between grain and fluid, what the grain's own flow may be.
OWN = 0.9


@dataclass(frozen=True)
class DragLaw:
    """What gives the drag on grains.

    Attributes
    ----------
    dimension : 2 or 3
    closure : function
        Of c, phi, Re, slip and r: force over slip, of a sphere.
    reynolds : function
        Re of slip and r.
    rho, eta, length : float
        Of the fluid; of the filter.
    own : array
        Flow of a grain's own over force/(eta length^(d-2)), at the R of :data:`TABLE`.
    own_share : float
        Share of the grains that a grain of volume 1 makes at its own place.
    structure : function
        Of phi.
    """

    dimension: int
    closure: Callable[..., Array]
    reynolds: Callable[..., Array]
    rho: float
    eta: float
    length: float
    own: Array
    own_share: float
    structure: Callable[[Array], Array]


def drag_law(closure: Closure, numbers: Mapping[str, float], dimension: int, length: float, extent: float) -> DragLaw:
    """Put together what gives the drag.

    Parameters
    ----------
    closure : Closure
        Of the drag on a sphere.
    numbers : mapping from str to float
        rho, eta, and the closure's parameters.
    dimension : 2 or 3
    length : float
        Of the filter.
    extent : float
        Shortest side of the fluid: in two dimensions the flow of a grain reaches as far, if it has no inertia.
    """
    from sympy import lambdify

    values = {symbol: numbers[symbol.name] for symbol in (arguments.rho, arguments.eta, *closure.parameters)}
    names = [arguments.c, arguments.phi, arguments.Re, arguments.slip, arguments.r]
    function = lambdify(names, closure.expression.subs(values), "numpy")
    own = _own_flow(dimension, 0.0 if dimension == 3 else own_flow.LEAST_WAVE_NUMBER * length / extent)
    share = float(own_flow.own_share(dimension)) / length**dimension
    structure = lambdify(arguments.phi, own_flow.structure_factor(dimension), "numpy")
    reynolds = lambdify([arguments.slip, arguments.r], arguments.REYNOLDS.subs(values), "numpy")
    return DragLaw(dimension, function, reynolds, numbers["rho"], numbers["eta"], length, own, share, structure)


@dataclass(frozen=True)
class Mixture:
    """The viscosity of fluid and grains together: by a closure of this name, a function of phi."""

    name: str
    viscosity: Callable[[Array], Array]


def mixture_of(closure: Closure, numbers: Mapping[str, float]) -> Mixture:
    """Viscosity of a mixture by a closure, which knows of the fraction of the grains alone."""
    from sympy import lambdify

    values = {symbol: numbers[symbol.name] for symbol in (arguments.rho, arguments.eta, *closure.parameters)}
    expression = closure.expression.subs(values).subs(arguments.c, 1 - arguments.phi)
    return Mixture(closure.name, lambdify(arguments.phi, expression, "numpy"))


def require_mixture(mixture: Mixture, share: float, where: str, t: float) -> None:
    """Refuse fractions up to which the viscosity is not finite, positive, and at least that of all lower ones.

    Parameters
    ----------
    mixture : Mixture
    share : float
        The largest fraction there is.
    where : str
        The place that has it.
    t : float

    Raises
    ------
    IntegrationError
    """
    phi = np.linspace(0.0, share, FRACTIONS)
    with np.errstate(all="ignore"):
        eta = mixture.viscosity(phi) * np.ones_like(phi)
        good = np.isfinite(eta) & (eta > 0) & (np.diff(eta, prepend=-np.inf) >= 0)
    if not good.all():
        k = int(np.argmin(good))
        raise IntegrationError(
            f"[fluid] mixture: the viscosity of the closure {mixture.name} is finite and grows with the fraction of "
            f"the grains up to {phi[k]:.3g} at most, and at t={t:.6g} there is {share:.3g} at {where}: give a closure "
            "that holds there, or contacts that keep grains apart"
        )


@cache
def _own_flow(d: int, least: float) -> Array:
    """Integral over the wave numbers from the least on, times length, at each R of the table."""
    from sympy import lambdify

    x, w = np.polynomial.legendre.leggauss(POINTS)
    # k = tan(angle), from the least to infinity
    start = np.arctan(least)
    angle = start + (np.pi / 2 - start) * (1 + x) / 2
    k, w = np.tan(angle), w * (np.pi / 2 - start) / 2 / np.cos(angle) ** 2
    closed = lambdify(own_flow.beta, own_flow.OVER_DIRECTIONS[d], "numpy")
    ratio = TABLE[:, None] / k
    directions = closed(ratio)
    if d == 3:  # where the closed form cancels, by quadrature
        near, inner = ratio < SMALL, lambdify((own_flow.beta, own_flow.n), own_flow.DIRECTIONS[d], "numpy")
        n, share = np.polynomial.legendre.leggauss(FEW)
        directions[near] = inner(ratio[near][:, None], (1 + n) / 2) @ (share / 2)
    return np.asarray(np.sum(w * lambdify(own_flow.k, own_flow.measure(d), "numpy")(k) * directions, axis=1))


def frictions(law: DragLaw, relative: Array, share: Array, volume: Array, radii: Array) -> tuple[Array, Array]:
    """Drag on grains over the velocity of the fluid, as the filter tells it, less theirs.

    Parameters
    ----------
    law : DragLaw
    relative : array, shape (grains,)
        Size of that velocity.
    share : array, shape (grains,)
        Share of the grains in the volume, as the filter tells it.
    volume, radii : array, shape (grains,)
        In two dimensions the volume is the area of a disc, whose drag per volume is that of a sphere.

    Returns
    -------
    friction, slip : array, shape (grains,)
        The slip is the velocity relative to the fluid that is not disturbed.

    Raises
    ------
    IntegrationError
        If a grain's own flow is nearly all of what the filter tells: the filter is too narrow for it; or if the drag
        does not settle, or the closure gives none.
    """
    own_share = law.own_share * volume
    others = np.clip(share - own_share, 0.0, None)
    part = law.structure(np.minimum(others, 0.99))
    phi = np.maximum(others + (1 - part) * np.minimum(own_share, share), LEAST_PHI)
    layer = volume / (4 / 3 * np.pi * radii**3)  # 1 of spheres
    slip, friction, before = relative, np.zeros_like(relative), np.zeros_like(relative)
    for _ in range(MOST):
        number = np.maximum(law.reynolds(slip, radii), 1e-20)
        alone = np.asarray(layer * law.closure(1 - phi, phi, number, slip, radii))
        if not (np.isfinite(alone) & (alone > 0)).all():
            k = int(np.argmin(np.isfinite(alone) & (alone > 0)))
            raise IntegrationError(
                f"[closures] drag: the closure gives {alone[k]:.3g} as the drag over the slip of grain {k}, at the "
                f"fraction {phi[k]:.3g} and the Reynolds number {number[k]:.3g}, where it does not hold: take another"
            )
        r = np.clip(law.rho * slip * law.length / law.eta, TABLE[0], TABLE[-1])
        own = part * np.interp(np.log(r), np.log(TABLE), law.own) / (law.eta * law.length ** (law.dimension - 2))
        if (own * alone > OWN).any():
            k = int(np.argmax(own * alone))
            raise IntegrationError(
                f"the flow that grain {k}, of radius {radii[k]:.3g}, makes of its own is {own[k] * alone[k]:.2g} of "
                f"its velocity in the fluid: [coupling] width = {2 * law.length:.3g} is too narrow for it"
            )
        before, friction = friction, alone / (1 - own * alone)
        slip = relative / (1 - own * alone)
        if (np.abs(friction - before) <= GOOD * friction).all():
            return friction, slip
    k = int(np.argmax(np.abs(friction - before) - GOOD * friction))
    raise IntegrationError(
        f"the drag on grain {k}, of radius {radii[k]:.3g}, does not settle: after {MOST} repetitions it changes from "
        f"{before[k]:.6g} to {friction[k]:.6g}, at the slip {slip[k]:.3g}; give a wider "
        "[coupling] width, or another drag"
    )
