"""A grain among others: Dallavalle's drag at the superficial velocity, times a power of c that depends on Re.

    F = C_d pi r^2 (rho/2) (c slip)^2 c^-beta      C_d = (0.63 + 4.8/sqrt(c Re))^2
    beta = 3.7 - 0.65 exp(-(1.5 - log10(c Re))^2/2)

Dallavalle, Micromeritics (1948); Di Felice, Int. J. Multiphase Flow 20 (1994) 153. Fitted between Re = 0.01 and 1e4. It
does not tend to Stokes' drag: 4.8^2 is 24/25 of 24.
"""

from sympy import Rational, exp, log, pi

from softdyn.derive.closure import Closure, Re, c, eta, r
from softdyn.derive.law import Limit

superficial = c * Re
dallavalle = (Rational(63, 100) * superficial ** Rational(1, 2) + Rational(48, 10)) ** 2  # C_d Re
beta = Rational(37, 10) - Rational(65, 100) * exp(-((Rational(3, 2) - log(superficial) / log(10)) ** 2) / 2)

closure = Closure(
    name="dallavalle_di_felice",
    gives="drag",
    description="drag on a grain among others, at any Re",
    source="Dallavalle 1948; Di Felice 1994, doi:10.1016/0301-9322(94)90011-6",
    expression=pi * eta * r / 4 * dallavalle * c ** (1 - beta),
    limits=(
        Limit("viscous", order=(Re, 1), claims={"drag": Rational(576, 100) * pi * eta * r * c ** -Rational(27, 10)}),
        Limit("Newton", order=(1, Re), claims={"C_d": Rational(63, 100) ** 2 * c ** -Rational(17, 10)}),
    ),
)
