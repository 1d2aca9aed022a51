"""The drag of MigFlow 1.4, to the letter: Dallavalle's, after Di Felice, but for two things.

    F/slip = eta (0.63 sqrt(c Re) + 4.8)^2 A/(2 d) c^-(2.8 - 0.65 exp(-(1.5 - ln(c Re))^2/2))

with d = 2 r, and A = pi r^2; in the plane A = d. Di Felice has log10 where this has ln, and c^-2.7 where it has c^-2.8:
see ``dallavalle_di_felice``.
"""

from sympy import Rational, exp, log, pi

from softdyn.derive.closure import Closure, Re, c, eta, r
from softdyn.derive.law import Limit

superficial = c * Re
dallavalle = (Rational(63, 100) * superficial ** Rational(1, 2) + Rational(48, 10)) ** 2
voidage = c ** -(Rational(28, 10) - Rational(65, 100) * exp(-((Rational(3, 2) - log(superficial)) ** 2) / 2))

closure = Closure(
    name="migflow_drag",
    gives="drag",
    description="drag of MigFlow 1.4, to the letter",
    source="MigFlow 1.4; Dallavalle 1948; Di Felice 1994, doi:10.1016/0301-9322(94)90011-6",
    expression=eta * dallavalle * pi * r**2 / (4 * r) * voidage,
    in_plane=eta * dallavalle / 2 * voidage,
    limits=(
        Limit("viscous", order=(Re, 1), claims={"drag": Rational(576, 100) * pi * eta * r * c ** -Rational(28, 10)}),
    ),
)
