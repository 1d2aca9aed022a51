"""A contact law: ``equal_spheres`` whose films break at a roughness, where asperities touch and rub.

Surfaces carry asperities, which touch below a gap h_r and bear a pressure there that grows without bound as they are
flattened. Between planes, with the stiffness P0 of what touches::

    pressure(h) = P0 ((h_r/h)^2 - 1)       h < h_r, else 0

Derjaguin's approximation gives the load of two spheres, pi R times the integral from h to h_r: F_adh below, continuous
at h_r with its first derivative. The form is a model, not a measured one: nearly rigid asperities, whose gap stays
within a small part of h_r, do not depend on it. What a film does at a gap below h_r is what it does between smooth
surfaces.

Where asperities touch they rub, in scenes with Coulomb friction: they bear that load, and are joined by a tangential
spring that is as stiff as the normal one but for Mindlin's factor 2 (1 - nu)/(2 - nu), that of one asperity and so of
all. The film slides and rolls beside them.

Typical: spheres of R = 20 um and E = 3 GPa with a roughness of 100 nm.
"""

from sympy import Piecewise, Rational, Symbol, pi

from softdyn.derive import LENGTH, PRESSURE, ContactLaw, E, F, Limit, R, Rubbing, delta, h
from softdyn.derive.laws.equal_spheres import film, modulus, near, nu
from softdyn.derive.laws.equal_spheres import law as equal_spheres

h_r = Symbol("h_r", positive=True)  # gap at which surfaces touch
P0 = Symbol("P0", positive=True)  # stiffness of asperities

load = Piecewise((pi * R * P0 * (h_r - h) ** 2 / h, h < h_r), (0, True))
slope = Piecewise((pi * R * P0 * (h_r**2 / h**2 - 1), h < h_r), (0, True))  # -d load/dh

law = ContactLaw(
    name="rough_spheres",
    description="equal_spheres whose films break at a roughness, where asperities touch and rub",
    source="Derjaguin's approximation; Mindlin (Johnson 1985, sec. 7.2); equal_spheres",
    a=equal_spheres.a,
    F_ela=equal_spheres.F_ela,
    zeta=equal_spheres.zeta,
    F_adh=load,
    unequal=equal_spheres.unequal,
    tangential=equal_spheres.tangential,
    rubbing=Rubbing(load=load, k_t=2 * (1 - nu) / (2 - nu) * slope),
    parameters={**equal_spheres.parameters, P0: PRESSURE, h_r: LENGTH},
    ranges=equal_spheres.ranges,
    typical={**equal_spheres.typical, P0: E / 10, h_r: R / 200},
    limits=(
        Limit(
            "Poiseuille",
            order=((delta, h, R), (h_r, h)),
            claims={
                "zeta": near,
                "delta": F / (2 * modulus * (R * h) ** Rational(1, 2)),
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        Limit("flattened", order=(h, h_r, R), claims={"F_adh": pi * R * P0 * h_r**2 / h}),
        Limit(
            "Hertz",
            order=((h, delta, R), (h_r, h)),
            claims={"a": (R * delta) ** Rational(1, 2), "zeta": film, "dh_dt": -F / film},
        ),
    ),
)
