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

Particles of different radii and tangential motion have one more, ``size_ratio`` = R1 R2/(R1 + R2)^2 of a pair: 1/4 of
equal spheres, 0 of a sphere and a plane. Surfaces that rub have ``slip_rate``, their speed along one another.
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
#: Speed of two surfaces that rub along one another: friction may depend on it.
slip_rate = Symbol("slip_rate", nonnegative=True)

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

#: Names that mean something else wherever a law's parameters do, and so cannot be theirs, with what they mean.
MEANINGS = {
    **{symbol.name: "one of the paper's symbols" for symbol in DIMENSIONS},
    "kappa": "F/(E R^2) in regimes, limits and sweeps",
    "size_ratio": "R1 R2/(R1 + R2)^2 of a pair",
    "slip_rate": "the speed of surfaces that rub",
    "force": "the external force in sweeps",
    "velocity": "that of the centres in sweeps",
    "compliance_p1": "that of a spring",
}
#: Names of what is derived: a law's own parameter of such a name is another symbol, and is shown as own_NAME.
DERIVED = frozenset(
    """
    C D X V t x zeta F_ela F_adh dF_dt dh_dt ddelta_dt dX_dt dF_ddelta dF_dh lambda1 lambda2 net newton
    a_h a_delta a_hh a_hdelta a_deltadelta F_a F_delta F_aa F_adelta F_deltadelta zeta_a zeta_h F_adh_a F_adh_h
    F_h F_ah F_hh F_hdelta F_adh_delta
    """.split()
)


class Parameter(Symbol):
    """A law's own parameter with the name of something that is derived: never equal to that, and shown apart."""

    __slots__ = ()

    def _sympystr(self, printer: object) -> str:
        return f"own_{self.name}"

    def _latex(self, printer: object) -> str:
        from softdyn.derive.typeset import symbol_latex

        return rf"{{{symbol_latex(self.name)}}}_{{\mathrm{{own}}}}"


#: Those of them that are material parameters.
COMMON_PARAMETERS: tuple[Symbol, ...] = (R, E, eta)
