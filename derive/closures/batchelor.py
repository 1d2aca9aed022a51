"""Spheres in pairs: eta (1 + 5/2 phi + B phi^2), with a coefficient that depends on the flow.

B = 6.2 with strong Brownian motion: Batchelor, J. Fluid Mech. 83 (1977) 97. In pure straining without it, 7.6:
Batchelor & Green, J. Fluid Mech. 56 (1972) 401. In shear without it the value depends on closed trajectories; 5.2 is in
use.
"""

from sympy import Rational, Symbol

from softdyn.derive.closure import Closure, eta, phi, viscosity
from softdyn.derive.closures.einstein import dilute
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import Limit

B = Symbol("B", positive=True)  # coefficient of pairs

closure = Closure(
    name="batchelor",
    gives="viscosity",
    description="viscosity of a suspension with interactions of pairs",
    source="Batchelor 1977, J. Fluid Mech. 83, 97; Batchelor & Green 1972, doi:10.1017/S0022112072002435",
    expression=eta * (1 + dilute + B * phi**2),
    parameters={B: DIMENSIONLESS},
    typical={B: Rational(62, 10)},
    limits=(
        Limit("dilute", order=(phi, 1), claims={viscosity / eta - 1: dilute, viscosity / eta - 1 - dilute: B * phi**2}),
    ),
)
