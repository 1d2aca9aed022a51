"""Hooke's spring: k (r - d)^2/2."""

from sympy import Symbol

from softdyn.derive.dimensions import FORCE, LENGTH
from softdyn.derive.law import Limit
from softdyn.derive.potential import Potential, r

k = Symbol("k", positive=True)  # stiffness
d = Symbol("d", nonnegative=True)  # length at rest

potential = Potential(
    name="hooke",
    description="a linear spring",
    source="Hooke 1678, De potentia restitutiva",
    energy=k * (r - d) ** 2 / 2,
    parameters={k: FORCE / LENGTH, d: LENGTH},
    typical={k: 1, d: 2},
    limits=(Limit("far", order=(d, r), claims={"F": -k * r}),),
)
