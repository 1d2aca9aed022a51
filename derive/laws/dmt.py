"""Two elastic spheres that attract each other across the gap around their contact: the theory of DMT, dry.

The profile is Hertz's, and the attraction that of undeformed spheres that touch: with the work of adhesion w, of both
surfaces and for an area, Derjaguin's force is 2 pi R* w, R* = R1 R2/(R1 + R2) = R/2 the reduced radius. That is what
pulls them apart (Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314; Maugis, Contact,
Adhesion and Rupture of Elastic Solids, 2000). At a gap h it is 2 pi R* W(h), with W = w z0^2/(z0 + h)^2 the energy of
van der Waals forces between half-spaces that touch at a distance z0 of their atoms (A = 12 pi w z0^2): no jump in force
as surfaces touch. For stiff, small particles and long-ranged forces: (R* w^2/(E*^2 z0^3))^(1/3) << 1 (Tabor).

In scenes with friction the surfaces bear the elastic force, and rub by mu (F + 2 pi R* w) at most: without a load, too
(Derjaguin, Z. Phys. 88 (1934) 661).
"""

from sympy import Interval, Rational, Symbol, oo, pi, sqrt

from softdyn.derive import (
    DIMENSIONLESS,
    FORCE,
    LENGTH,
    ContactLaw,
    E,
    F,
    Limit,
    R,
    Rubbing,
    Tangential,
    a,
    delta,
    h,
)

nu = Symbol("nu", real=True)  # Poisson's ratio
w = Symbol("w", positive=True)  # work of adhesion
z0 = Symbol("z0", positive=True)  # distance at which surfaces touch

modulus = E / (1 - nu**2)
elastic = Rational(4, 3) * modulus * a * delta
k_t = 2 * E * a / ((1 + nu) * (2 - nu))  # Mindlin (Johnson 1985, sec. 7.2), where both surfaces stick
pull_off = pi * w * R  # 2 pi w R*

law = ContactLaw(
    name="dmt",
    description="two elastic spheres with adhesion around their contact, dry: Derjaguin, Muller and Toporov",
    source="Derjaguin, Muller & Toporov 1975, doi:10.1016/0021-9797(75)90018-1",
    a=sqrt(R * delta),
    F_ela=elastic,
    zeta=0,
    F_adh=-pull_off * z0**2 / (z0 + h) ** 2,
    tangential=Tangential(sliding=oo, k_t=k_t),
    rubbing=Rubbing(load=elastic, k_t=k_t),
    parameters={nu: DIMENSIONLESS, w: FORCE / LENGTH, z0: LENGTH},
    ranges={nu: Interval.Lopen(-1, Rational(1, 2))},
    typical={nu: Rational(1, 2), w: E * R / 10**6, z0: R / 10**4},
    limits=(
        Limit("pull-off", order=((delta, R), (E * delta ** Rational(3, 2), w * sqrt(R))), claims={"F": -pull_off}),
        Limit(
            "Hertz",
            order=((delta, R), (w * sqrt(R), E * delta ** Rational(3, 2))),
            claims={
                "a": sqrt(R * delta),
                "F": Rational(4, 3) * modulus * sqrt(R) * delta ** Rational(3, 2),
                "delta": (3 * F / (4 * modulus * sqrt(R))) ** Rational(2, 3),
                "C": modulus * sqrt(R * delta),
            },
        ),
    ),
)
