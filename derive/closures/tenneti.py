"""A grain among others, from simulations that resolve the flow past fixed random arrays.

    F = 6 pi eta r c^2 slip f                                  Re_m = c Re
    f = (1 + 0.15 Re_m^0.687)/c^3 + 5.81 phi/c^3 + 0.48 phi^(1/3)/c^4 + phi^3 Re_m (0.95 + 0.61 phi^3/c^2)

Tenneti, Garg & Subramaniam, Int. J. Multiphase Flow 37 (2011) 1072: 6 pi eta r c f is all that the fluid does to a
grain per slip; what of it the shared pressure does is left out of F by one more c. Fitted for 0.01 < Re_m < 300 and
0.1 < phi < 0.5. Codes differ in the first term: over c^3, as here, in most; over c^2 in OpenFOAM.
"""

from sympy import Rational

from softdyn.derive.closure import Closure, Re, c, phi
from softdyn.derive.closures.schiller_naumann import inertial as alone_with_inertia
from softdyn.derive.closures.stokes import alone
from softdyn.derive.law import Limit

mean = c * Re  # Re_m
among_others = Rational(581, 100) * phi / c**3 + Rational(48, 100) * phi ** Rational(1, 3) / c**4
both = phi**3 * mean * (Rational(95, 100) + Rational(61, 100) * phi**3 / c**2)

closure = Closure(
    name="tenneti",
    gives="drag",
    description="drag on a grain among others, from simulations that resolve the flow",
    source="Tenneti, Garg & Subramaniam 2011, doi:10.1016/j.ijmultiphaseflow.2011.05.010",
    expression=alone * c**2 * (alone_with_inertia.subs(Re, mean) / c**3 + among_others + both),
    limits=(
        Limit("viscous", order=(Re, 1), claims={"drag": alone * (1 / c + c**2 * among_others)}),
        Limit("inertial", order=(1, Re), claims={"drag": alone * c**2 * both}),
        Limit("Stokes", order=((Re, 1), (phi, 1)), claims={"drag": alone}),
    ),
)
