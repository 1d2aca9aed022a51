"""The symbols of the paper, as a law uses them.

========= ====================================================== ===========
symbol    meaning                                                dimension
========= ====================================================== ===========
R         particle radius                                        length
E         elastic modulus                                        pressure
eta       viscosity of the fluid                                 viscosity
h         gap, surface to surface                                length
delta     deflection of one surface, > 0 in compression          length
a         radius of the interacting region                       length
F         force transmitted by the contact, > 0 pushes apart     force
kappa     F/(E R^2)                                              none
========= ====================================================== ===========

Tangential motion has one more, ``size_ratio`` = R1 R2/(R1 + R2)^2 of a pair: 1/4 of equal spheres, 0 of a sphere and a
plane.
"""

from sympy import Expr, Symbol

from softdyn.derive.dimensions import FORCE, LENGTH, PRESSURE, VISCOSITY, Dimension

R = Symbol("R", positive=True)
E = Symbol("E", positive=True)
eta = Symbol("eta", positive=True)
h = Symbol("h", positive=True)
delta = Symbol("delta", real=True)
a = Symbol("a", positive=True)
F = Symbol("F", real=True)
kappa: Expr = F / (E * R**2)
size_ratio = Symbol("size_ratio", nonnegative=True)

#: Symbols that any law may use without declaring them, with their dimensions.
DIMENSIONS: dict[Symbol, Dimension] = {
    R: LENGTH,
    E: PRESSURE,
    eta: VISCOSITY,
    h: LENGTH,
    delta: LENGTH,
    a: LENGTH,
    F: FORCE,
}

#: Those of them that are material parameters.
COMMON_PARAMETERS: tuple[Symbol, ...] = (R, E, eta)
