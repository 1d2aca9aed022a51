"""Cohesion that flow switches on, and that takes time: Morse's well, times an activation.

Platelets of blood hold to one another where the shear rate is large, as the proteins that bind them stretch, and bonds
form one by one: U = 0 far apart, and the well is De (1 - exp(-age/tau)) s^2/(1 + s^2) deep, s = shear_rate/threshold.
"""

from sympy import Symbol, exp

from softdyn.derive.dimensions import ENERGY, LENGTH, TIME
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, age, r, shear_rate

De = Symbol("De", positive=True)  # depth of the well of old contacts in a fast flow
b = Symbol("b", positive=True)  # one over the width
d = Symbol("d", positive=True)  # distance at rest
tau = Symbol("tau", positive=True)  # time in which a contact matures
threshold = Symbol("threshold", positive=True)  # shear rate of half the depth

s = shear_rate / threshold

potential = Potential(
    name="platelet",
    description="Morse's well, that shear switches on and that matures: platelets",
    source="Morse 1929, doi:10.1103/PhysRev.34.57; activation: this project",
    energy=De * (exp(-2 * b * (r - d)) - 2 * exp(-b * (r - d))),
    activation=(1 - exp(-age / tau)) * s**2 / (1 + s**2),
    parameters={De: ENERGY, b: LENGTH**-1, d: LENGTH, tau: TIME, threshold: TIME**-1},
    typical={De: 1, b: 4, d: 2, tau: 1, threshold: 1},
    limits=(Limit("far", order=(1 / b, r - d), claims={"U": -2 * De * exp(-b * (r - d))}),),
)
