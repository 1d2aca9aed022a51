"""Two elastic spheres without a fluid: what is left of ``equal_spheres`` as eta -> 0.

Hertz's contact alone, quasi-static: no gap, h = 0, and the centres follow the force, dX/dt = -(dF/dt)/C.
"""

from sympy import Rational, oo, sqrt

from softdyn.derive import E, F, Limit, R, Tangential, a, delta
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.equal_spheres import nu
from softdyn.derive.one_sided import dry

modulus = E / (1 - nu**2)

law = dry(
    equal_spheres,
    name="hertz_dry",
    description="two elastic spheres, Hertz's contact alone: equal_spheres as eta -> 0",
    source="Hertz (Johnson, Contact Mechanics, 1985, ch. 4)",
    # where both surfaces stick: 8 G* a of Mindlin (Johnson, sec. 7.2), 1/G* = 2 (2 - nu)/G, G = E/(2 (1 + nu))
    tangential=Tangential(sliding=oo, k_t=2 * E * a / ((1 + nu) * (2 - nu))),
    limits=(
        Limit(
            "Hertz",
            order=(delta, R),
            claims={
                "a": sqrt(R * delta),
                "F": Rational(4, 3) * modulus * sqrt(R) * delta ** Rational(3, 2),
                "delta": (3 * F / (4 * modulus * sqrt(R))) ** Rational(2, 3),
                "C": modulus * sqrt(R * delta),
            },
        ),
    ),
)
