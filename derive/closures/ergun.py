"""A bed of grains at rest: Ergun's pressure drop, as the drag that makes it.

    -dp/dx = 150 eta phi^2 U/(c^3 d^2) + 1.75 rho phi U^2/(c^3 d)      U = c slip, d = 2 r

The drag on all grains is -c dp/dx, as the pressure is shared, so that each of them has -c dp/dx V/phi, V = 4 pi r^3/3.

Ergun, Chem. Eng. Prog. 48 (1952) 89. Measured in packed beds; dilute it falls below Stokes' drag, and vanishes.
"""

from sympy import Rational, pi

from softdyn.derive.closure import Closure, Re, c, eta, phi, r
from softdyn.derive.law import Limit

viscous = 50 * pi * eta * r * phi / c
inertial = Rational(7, 12) * pi * eta * r * Re

closure = Closure(
    name="ergun",
    gives="drag",
    description="drag on a grain of a packed bed",
    source="Ergun 1952, Chem. Eng. Prog. 48, 89",
    expression=viscous + inertial,
    limits=(
        Limit("Blake-Kozeny", order=(Re, 1), claims={"drag": viscous}),
        Limit("Burke-Plummer", order=(1, Re), claims={"drag": inertial, "C_d": Rational(7, 3)}),
    ),
)
