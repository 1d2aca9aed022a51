"""A grain among others, from lattice-Boltzmann simulations of random arrays, at Re that is not small.

    F = 6 pi eta r c^2 slip (F_0 + F_3 Re_s/2)                 Re_s = c Re
    F_0 = (1 + 3 sqrt(phi/2) + 135/64 phi ln phi + 16.14 phi)/(1 + 0.681 phi - 8.48 phi^2 + 8.16 phi^3), phi < 0.4
        = 10 phi/c^3 else
    F_3 = 0.0673 + 0.212 phi + 0.0232/c^5

Koch & Hill, Annu. Rev. Fluid Mech. 33 (2001) 619; Hill, Koch & Ladd, J. Fluid Mech. 448 (2001) 243. Their Reynolds
number is that of the radius, hence the half. The two forms of F_0 differ by 1 % where they meet. 16.14 is the number of
CFDEMcoupling; MFIX has 17.14, with which they would differ by 4 %. At small Re the authors have a form of their own, in
Re^2, which is left out here.
"""

from sympy import Piecewise, Rational, log, sqrt

from softdyn.derive.closure import Closure, Re, c, phi
from softdyn.derive.closures.stokes import alone
from softdyn.derive.law import Limit

dilute = (1 + 3 * sqrt(phi / 2) + Rational(135, 64) * phi * log(phi) + Rational(1614, 100) * phi) / (
    1 + Rational(681, 1000) * phi - Rational(848, 100) * phi**2 + Rational(816, 100) * phi**3
)
dense = 10 * phi / c**3
inertial = (Rational(673, 10000) + Rational(212, 1000) * phi + Rational(232, 10000) / c**5) * c * Re / 2

closure = Closure(
    name="koch_hill",
    gives="drag",
    description="drag on a grain among others, from simulations of arrays at Re that is not small",
    source="Koch & Hill 2001, Annu. Rev. Fluid Mech. 33, 619; Hill, Koch & Ladd 2001, doi:10.1017/S0022112001005936",
    expression=alone * c**2 * (Piecewise((dilute, phi < Rational(2, 5)), (dense, True)) + inertial),
    limits=(
        Limit("Stokes", order=((Re, 1), (phi, 1)), claims={"drag": alone}),
        Limit("Carman-Kozeny", order=(Re, c, 1), claims={"drag": 10 * alone / c}),
        Limit("inertial", order=(1, Re), claims={"drag": alone * c**2 * inertial}),
    ),
)
