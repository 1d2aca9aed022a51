"""A screened charge: A ell exp(-(r - contact)/ell)/r, A ell/contact being the energy of two particles that touch.

Yukawa's form, of charged spheres in an electrolyte by Debye and Hückel (Phys. Z. 24 (1923) 185); the particles' charge
sits on their surfaces, so that the exponential counts from contact. ell is the screening length.
"""

from sympy import Symbol, exp

from softdyn.derive.dimensions import ENERGY, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, contact, r

A = Symbol("A", real=True)  # > 0 repels
ell = Symbol("ell", positive=True)  # screening length

potential = Potential(
    name="yukawa",
    description="screened charges, counted from the surfaces",
    source="Debye & Hückel 1923, Phys. Z. 24, 185; Yukawa 1935, doi:10.11429/ppmsj1919.17.0_48",
    energy=A * ell * exp(-(r - contact) / ell) / r,
    parameters={A: ENERGY, ell: LENGTH},
    typical={A: 1, ell: 1},
    limits=(
        Limit("Coulomb", order=((r, ell), (contact, ell)), claims={"F": A * ell / r**2}),
        Limit("screened", order=(ell, r - contact), claims={"F": A * exp(-(r - contact) / ell) / r}),
    ),
)
