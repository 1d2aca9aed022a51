"""A sphere alone, with inertia: C_d = 24/Re (1 + 0.15 Re^0.687) up to Re = 1000, then 0.44.

Schiller & Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318; the constant is Newton's, as it is commonly joined to it. The two
differ by 0.4 % where they meet.
"""

from sympy import Piecewise, Rational

from softdyn.derive.closure import Closure, Re
from softdyn.derive.closures.stokes import alone
from softdyn.derive.law import Limit

inertial = 1 + Rational(15, 100) * Re ** Rational(687, 1000)
newton = Rational(44, 100)  # C_d

closure = Closure(
    name="schiller_naumann",
    gives="drag",
    description="drag on a sphere alone, with inertia, joined to Newton's",
    source="Schiller & Naumann 1933, Z. Ver. Dtsch. Ing. 77, 318",
    expression=alone * Piecewise((inertial, Re < 1000), (newton * Re / 24, True)),
    limits=(
        Limit("Stokes", order=(Re, 1), claims={"drag": alone, "C_d": 24 / Re}),
        Limit("Newton", order=(1, Re), claims={"C_d": newton}),
    ),
)
