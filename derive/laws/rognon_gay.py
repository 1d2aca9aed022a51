"""Two elastic spheres in a viscous fluid, to the letter of Rognon & Gay, arXiv 0803.1573, eqs. 3 to 5.

The paper leaves the prefactors of its limits out; those below are exact for the law as printed. They are not those of
two equal spheres: near contact the paper's friction is that of a sphere and a plane. The law is meant for spheres that
are pressed together: its abs(delta) widens a film that is pulled, and holds it shut; a real one narrows and opens.
"""

from sympy import Abs, Rational, pi, sqrt

from softdyn.derive import ContactLaw, E, F, Limit, R, a, delta, eta, h, kappa

hbar = R * h / (R + h)  # the smaller of gap and radius, smoothly

# the force that appears in all three deflections: F/(E R^2) = kappa
k = 9 * kappa / (4 * sqrt(2))

law = ContactLaw(
    name="rognon_gay",
    description="two elastic spheres pressed together in a viscous fluid: Stokes, Poiseuille, Hertz",
    source="Rognon & Gay, arXiv:0803.1573, eqs. 3-5",
    a=sqrt(2 * R * (hbar + Abs(delta))),
    F_ela=Rational(4, 9) * E * a * delta,
    zeta=3 * pi * eta * a**4 / (2 * hbar**3),
    F_adh=0,
    limits=(
        Limit(
            "Stokes",
            order=(delta, R, h),
            claims={
                "a": sqrt(2) * R,
                "zeta": 6 * pi * eta * R,
                "delta": R * k,
                "dh_dt": -F / (6 * pi * eta * R),
            },
        ),
        Limit(
            "Poiseuille",
            order=(delta, h, R),
            claims={
                "a": sqrt(2 * R * h),
                "zeta": 6 * pi * eta * R**2 / h,
                "delta": R * k * sqrt(R / h),
                "dh_dt": -F * h / (6 * pi * eta * R**2),
            },
        ),
        Limit(
            "Hertz",
            order=(h, delta, R),
            claims={
                "a": sqrt(2 * R * delta),
                "zeta": 3 * pi * eta * (2 * R * delta) ** 2 / (2 * h**3),
                "delta": R * k ** Rational(2, 3),
                "dh_dt": -F * h**3 / (6 * pi * eta * R**4) * k ** Rational(-4, 3),
            },
        ),
    ),
)
