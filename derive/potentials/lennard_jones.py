"""The potential of Lennard-Jones: 4 epsilon ((sigma/r)^12 - (sigma/r)^6).

Lennard-Jones, Proc. Phys. Soc. 43 (1931) 461. Its bottom, -epsilon, is at 2^(1/6) sigma: cut off there it repels alone,
which is the potential of Weeks, Chandler and Andersen (J. Chem. Phys. 54 (1971) 5237).
"""

from sympy import Symbol

from softdyn.derive.dimensions import ENERGY, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, r

epsilon = Symbol("epsilon", positive=True)  # depth of the well
sigma = Symbol("sigma", positive=True)  # where the energy is 0

potential = Potential(
    name="lennard_jones",
    description="a hard core and a weak attraction: the 12-6 potential",
    source="Lennard-Jones 1931, doi:10.1088/0959-5309/43/5/301",
    energy=4 * epsilon * ((sigma / r) ** 12 - (sigma / r) ** 6),
    parameters={epsilon: ENERGY, sigma: LENGTH},
    typical={epsilon: 1, sigma: 2},
    limits=(
        Limit("core", order=(r, sigma), claims={"F": 48 * epsilon * sigma**12 / r**13}),
        Limit("far", order=(sigma, r), claims={"F": -24 * epsilon * sigma**6 / r**7}),
    ),
)
