"""The flow that a grain makes of its own where a filter tells it the velocity of the fluid: declared and derived.

A force F on the fluid, spread by a filter of the transform 1/(1 + l^2 k^2)^2 and looked at through the same filter,
moves the fluid there, in steady flow past it of the speed U (Oseen 1910; in Stokes flow U = 0), by

    u = F/(2 pi)^d integral of (1 - (k.F)^2/(k^2 F^2)) eta k^2/((eta k^2)^2 + (rho U.k)^2) / (1 + l^2 k^2)^4 d^d k .

A closure's drag is that at the velocity that the fluid would have without the grain: that which the filter tells, less
u. In two dimensions and without inertia the integral has no lower end, for the flow of a
line of force reaches as far as there is fluid. There it starts at the wave number that gives a line in a square cell of
side L the mobility that it has there, (ln(L/a) - 1.3105)/(4 pi eta) (Hasimoto, J. Fluid Mech. 5 (1959) 317). In units
of F/(eta l^(d-2)), with k in units of 1/l and R = rho U l/eta, the integral over directions is done here.

So much is of one grain alone. Of many, the force on the fluid near a grain exceeds the mean by that of the grain and
falls short of it by those that the grain keeps away. Where the filter is wider than the order among grains the two
together are the grain's own times their structure factor S at k = 0, which follows from their equation of state:
1/S = d(phi Z)/dphi (Hansen & McDonald, Theory of Simple Liquids). In a packed bed next to nothing is left: the
velocity that the closure of a bed is written in is the mean one.
"""

from __future__ import annotations

from functools import cache
from math import exp

from sympy import Expr, Integer, Symbol, atan, factor, integrate, oo, pi, simplify, sqrt

from softdyn.derive.closure import phi

#: Wave number times l; rho U l/eta; their ratio R/k.
k, R, beta = Symbol("k", positive=True), Symbol("R", positive=True), Symbol("beta", positive=True)
#: Transform of the filter, twice: as it spreads, and as it tells.
TWICE = 1 / (1 + k**2) ** 4
#: Equation of state of hard spheres (Carnahan & Starling 1969), of hard discs (Helfand, Frisch & Lebowitz 1961).
Z = {2: 1 / (1 - phi) ** 2, 3: (1 + phi + phi**2 - phi**3) / (1 - phi) ** 3}
#: Least wave number times L in two dimensions: -ln(k a) + ln 2 - gamma is ln(L/a) - 1.3105.
LEAST_WAVE_NUMBER = 2 * exp(1.3105 - 0.5772156649015329)
#: Component of a direction along the flow.
n = Symbol("n", positive=True)
#: What is integrated over it, from 0 to 1: (1 - n^2)/(1 + beta^2 n^2) times the directions that have it.
DIRECTIONS = {2: 4 * sqrt(1 - n**2) / (1 + beta**2 * n**2), 3: 4 * pi * (1 - n**2) / (1 + beta**2 * n**2)}
#: The integrals; that in three dimensions cancels at small beta. Tests hold them against quadrature.
OVER_DIRECTIONS = {
    2: 2 * pi / (1 + sqrt(1 + beta**2)),
    3: 4 * pi * ((1 + beta**2) * atan(beta) - beta) / beta**3,
}


@cache
def measure(d: int) -> Expr:
    """What OVER_DIRECTIONS, at beta = R/k, is multiplied with, to be integrated over k: u over F/(eta l^(d-2))."""
    return k ** Integer(d - 3) * TWICE / (2 * pi) ** d


@cache
def own_share(d: int) -> Expr:
    """Share phi of a grain of volume 1 alone, told by the filter at its place, in units of l^-d."""
    sphere = {2: 2 * pi, 3: 4 * pi}[d]
    return simplify(integrate(sphere * k ** (d - 1) * TWICE, (k, 0, oo)) / (2 * pi) ** d)


@cache
def structure_factor(d: int) -> Expr:
    """Of hard spheres, or discs, at the wave number 0."""
    return factor(1 / (phi * Z[d]).diff(phi))
