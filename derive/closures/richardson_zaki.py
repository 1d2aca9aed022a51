"""Grains that settle together: the superficial velocity is c^n times that of one grain alone, whose Re it is.

    n = 4.65 (Re < 0.2), 4.35 Re^-0.03 (Re < 1), 4.45 Re^-0.1 (Re < 500), 2.39

Richardson & Zaki, Trans. Inst. Chem. Eng. 32 (1954) 35, far from walls. The pieces do not quite meet.
"""

from sympy import Piecewise, Rational

from softdyn.derive.closure import Closure, Re, c, phi, settling
from softdyn.derive.law import Limit

slow, fast = Rational(465, 100), Rational(239, 100)
n = Piecewise(
    (slow, Re < Rational(1, 5)),
    (Rational(435, 100) * Re ** -Rational(3, 100), Re < 1),
    (Rational(445, 100) * Re ** -Rational(1, 10), Re < 500),
    (fast, True),
)

closure = Closure(
    name="richardson_zaki",
    gives="settling",
    description="settling of grains that hinder each other",
    source="Richardson & Zaki 1954, Trans. Inst. Chem. Eng. 32, 35",
    expression=c**n,
    limits=(
        Limit("Stokes", order=(Re, 1), claims={"settling": c**slow}),
        Limit("Newton", order=(1, Re), claims={"settling": c**fast}),
        Limit("dilute, slow", order=((phi, 1), (Re, 1)), claims={1 - settling: slow * phi}),
    ),
)
