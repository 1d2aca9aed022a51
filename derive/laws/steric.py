"""Two equal elastic spheres that carry polymer brushes: ``equal_spheres`` with the force of Alexander and de Gennes.

Brushes of length L, one chain on each s^2 of surface, touch at h = 2 L. Between planes (Alexander, J. Phys. France 38
(1977) 983; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; prefactors of order one are left out there, and
here)::

    pressure(h) = Pi0 ((2 L/h)^(9/4) - (h/(2 L))^(3/4))       h < 2 L, else 0;  Pi0 = k T/s^3

the swelling of the chains against their tension. Derjaguin's approximation gives the force between spheres, pi R
times the integral from h to 2 L: F_adh below, exact, continuous at 2 L with its first derivative. Scaling theory, for
a strongly compressed brush (h < L, say) a guide only; the fluid's way through the brush is not in the friction; the
spheres are taken as round, right for delta << L.

Typical: gel beads, R = 10 um, E = 100 kPa, with poly(ethylene oxide) brushes, L = 10 nm, s = 3 nm, at 300 K: Pi0 =
150 kPa.
"""

from sympy import Piecewise, Rational, Symbol, pi, sqrt

from softdyn.derive import LENGTH, PRESSURE, ContactLaw, E, F, Limit, R, delta, h
from softdyn.derive.laws.equal_spheres import film, modulus, near
from softdyn.derive.laws.equal_spheres import law as equal_spheres

Pi0 = Symbol("Pi0", positive=True)  # kT/s^3, with s the distance between grafting points
L = Symbol("L", positive=True)  # length of the brushes, not compressed

x = h / (2 * L)
energy = 2 * L * Pi0 * (Rational(4, 5) * x ** Rational(-5, 4) + Rational(4, 7) * x ** Rational(7, 4) - Rational(48, 35))
compressed = 8 * pi * R * L * Pi0 / 5 * x ** Rational(-5, 4)

law = ContactLaw(
    name="steric",
    description="equal_spheres with polymer brushes (Alexander, de Gennes)",
    source="Alexander 1977; de Gennes, Adv. Colloid Interface Sci. 27 (1987) 189; equal_spheres",
    a=equal_spheres.a,
    F_ela=equal_spheres.F_ela,
    zeta=equal_spheres.zeta,
    F_adh=Piecewise((pi * R * energy, h < 2 * L), (0, True)),
    unequal=equal_spheres.unequal,
    tangential=equal_spheres.tangential,
    parameters={**equal_spheres.parameters, Pi0: PRESSURE, L: LENGTH},
    ranges=equal_spheres.ranges,
    typical={**equal_spheres.typical, Pi0: 3 * E / 2, L: R / 1000},
    limits=(
        Limit(
            "Poiseuille",
            order=((delta, h, R), (L, h)),
            claims={
                "zeta": near,
                "delta": F / (2 * modulus * sqrt(R * h)),
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        Limit("brushes", order=(h, L, R), claims={"F_adh": compressed}),
        # Pi0 and E are of one order, so that the brushes' scale is E L R
        Limit(
            "pushed apart",
            order=((delta, h, L, R), (F, E * L * R)),
            claims={"dh_dt": compressed / near, "dX_dt": compressed / near},
        ),
        Limit(
            "Hertz",
            order=((h, delta, R), (L, h)),
            claims={
                "a": sqrt(R * delta),
                "zeta": film,
                "delta": (3 * F / (4 * modulus * sqrt(R))) ** Rational(2, 3),
                "dh_dt": -F / film,
            },
        ),
        Limit(
            "Hertz on brushes",
            order=((h, delta, R), (h, L), (E * R * L**3, F * h**2)),
            claims={"dh_dt": -F / film},
        ),
    ),
)
