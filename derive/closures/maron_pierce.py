"""A suspension up to its densest packing: eta (1 - phi/phi_max)^-2.

Maron & Pierce, J. Colloid Sci. 11 (1956) 80. Dilute it is 1 + 2 phi/phi_max: Einstein's only if phi_max = 0.8. Typical:
phi_max = 0.64, spheres packed at random.
"""

from sympy import Rational, Symbol

from softdyn.derive.closure import Closure, eta, phi, viscosity
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import Limit

phi_max = Symbol("phi_max", positive=True)  # of the densest packing

closure = Closure(
    name="maron_pierce",
    gives="viscosity",
    description="viscosity of a suspension, diverging as the square of what is left to its densest packing",
    source="Maron & Pierce 1956, J. Colloid Sci. 11, 80",
    expression=eta * (1 - phi / phi_max) ** -2,
    parameters={phi_max: DIMENSIONLESS},
    ranges={phi_max: (0, 1)},
    typical={phi_max: Rational(64, 100)},
    limits=(
        Limit("dilute", order=(phi, 1), claims={viscosity / eta - 1: 2 * phi / phi_max}),
        Limit("dense", order=(phi_max - phi, 1), claims={"viscosity": eta * (phi_max / (phi_max - phi)) ** 2}),
    ),
)
