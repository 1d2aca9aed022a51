"""A suspension up to its densest packing: eta (1 - phi/phi_max)^(-B phi_max), with B = 5/2 of spheres.

Krieger & Dougherty, Trans. Soc. Rheol. 3 (1959) 137. B is the intrinsic viscosity: dilute it is Einstein's. Typical:
phi_max = 0.64, spheres packed at random.
"""

from sympy import Rational, Symbol

from softdyn.derive.closure import Closure, eta, phi, viscosity
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import Limit

phi_max = Symbol("phi_max", positive=True)  # of the densest packing
B = Symbol("B", positive=True)  # intrinsic viscosity

closure = Closure(
    name="krieger_dougherty",
    gives="viscosity",
    description="viscosity of a suspension up to its densest packing",
    source="Krieger & Dougherty 1959, doi:10.1122/1.548848",
    expression=eta * (1 - phi / phi_max) ** (-B * phi_max),
    parameters={phi_max: DIMENSIONLESS, B: DIMENSIONLESS},
    ranges={phi_max: (0, 1)},
    typical={phi_max: Rational(64, 100), B: Rational(5, 2)},
    limits=(
        Limit("dilute", order=(phi, 1), claims={viscosity / eta - 1: B * phi}),
        Limit(
            "dense",
            order=(phi_max - phi, 1),
            claims={"viscosity": eta * (phi_max / (phi_max - phi)) ** (B * phi_max)},
        ),
    ),
)
