"""Morse's potential: De (1 - exp(-b (r - d)))^2, a well of the depth De and the width 1/b at the distance d.

Morse, Phys. Rev. 34 (1929) 57: of two atoms then, of cohesive grains and cells now. U = 0 at its bottom.
"""

from sympy import Symbol, exp

from softdyn.derive.dimensions import ENERGY, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, r

De = Symbol("De", positive=True)  # depth
b = Symbol("b", positive=True)  # one over the width
d = Symbol("d", positive=True)  # distance at rest

potential = Potential(
    name="morse",
    description="a well of finite depth, repulsion within: cohesion",
    source="Morse 1929, doi:10.1103/PhysRev.34.57",
    energy=De * (1 - exp(-b * (r - d))) ** 2,
    parameters={De: ENERGY, b: LENGTH**-1, d: LENGTH},
    typical={De: 1, b: 4, d: 2},
    limits=(
        Limit("harmonic, stretched", order=(r - d, 1 / b), claims={"U": De * b**2 * (r - d) ** 2}),
        Limit("harmonic, pressed", order=(d - r, 1 / b), claims={"F": 2 * De * b**2 * (d - r)}),
        Limit("far", order=(1 / b, r - d), claims={"U": De, "F": -2 * De * b * exp(-b * (r - d))}),
    ),
)
