"""A grain among others, from lattice-Boltzmann simulations of random arrays.

    F = 6 pi eta r c slip f
    f = 10 phi/c^2 + c^2 (1 + 1.5 sqrt(phi))
        + 0.413 Re_s/(24 c^2) (1/c + 3 c phi + 8.4 Re_s^-0.343)/(1 + 10^(3 phi) Re_s^-(1 + 4 phi)/2)      Re_s = c Re

Beetstra, van der Hoef & Kuipers, AIChE J. 53 (2007) 489. Fitted up to Re_s = 1000 and phi = 0.6.
"""

from sympy import Integer, Rational, pi, sqrt

from softdyn.derive.closure import Closure, Re, c, eta, phi, r
from softdyn.derive.closures.stokes import alone
from softdyn.derive.law import Limit

superficial = c * Re
viscous = 10 * phi / c**2 + c**2 * (1 + Rational(3, 2) * sqrt(phi))
inertial = (
    Rational(413, 1000) * superficial / (24 * c**2)
    * (1 / c + 3 * c * phi + Rational(84, 10) * superficial ** -Rational(343, 1000))
    / (1 + Integer(10) ** (3 * phi) * superficial ** (-(1 + 4 * phi) / 2))
)  # fmt: skip

closure = Closure(
    name="beetstra",
    gives="drag",
    description="drag on a grain among others, from simulations of arrays",
    source="Beetstra, van der Hoef & Kuipers 2007, doi:10.1002/aic.11065",
    expression=alone * c * (viscous + inertial),
    limits=(
        Limit("viscous", order=(Re, 1), claims={"drag": alone * c * viscous}),
        Limit("Stokes", order=((Re, 1), (phi, 1)), claims={"drag": alone}),
        Limit("Carman-Kozeny", order=((Re, 1), (c, 1)), claims={"drag": 60 * pi * eta * r / c}),
    ),
)
