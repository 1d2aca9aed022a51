"""A grain among others, by two laws: that of Ergun where c < 0.8, that of Wen and Yu where it is not.

    F = C_d pi r^2 (rho/2) c slip^2 c^-2.65      C_d as Schiller & Naumann have it, at c Re

Gidaspow, Multiphase Flow and Fluidization (1994); Wen & Yu, Chem. Eng. Prog. Symp. Ser. 62 (1966) 100. The two laws do
not meet at c = 0.8: there the drag jumps.
"""

from sympy import Piecewise, Rational, pi

from softdyn.derive.closure import Closure, Re, c, eta, phi, r
from softdyn.derive.closures.ergun import closure as ergun
from softdyn.derive.closures.schiller_naumann import closure as schiller_naumann
from softdyn.derive.closures.stokes import alone
from softdyn.derive.law import Limit

wen_yu = schiller_naumann.expression.subs(Re, c * Re) * c ** -Rational(265, 100)

closure = Closure(
    name="gidaspow",
    gives="drag",
    description="drag on a grain: Ergun's in a bed, Wen and Yu's else, with a jump",
    source="Gidaspow 1994, Multiphase Flow and Fluidization; Wen & Yu 1966, Chem. Eng. Prog. Symp. Ser. 62, 100",
    expression=Piecewise((ergun.expression, c < Rational(4, 5)), (wen_yu, True)),
    limits=(
        Limit("Stokes", order=((Re, 1), (phi, 1)), claims={"drag": alone}),
        Limit("Blake-Kozeny", order=((Re, 1), (c, 1)), claims={"drag": 50 * pi * eta * r / c}),
    ),
)
