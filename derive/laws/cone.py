"""Two blunt cones pressed tip to tip: an elastic force quadratic in delta, and exponents that are not the paper's.

Two equal cones whose surfaces rise by m r at a distance r from the axis, of plane-strain modulus E (that is, E/(1 -
nu^2) of a solid), touch over a radius a = c delta with c = 2/(pi m), and F = E a delta: Love, Q. J. Math. 10 (1939)
161; Sneddon, Int. J. Eng. Sci. 3 (1965) 47, with the slopes and the compliances of both bodies added. Their tips are
rounded to a radius R, which rules the lubrication: a = sqrt(2 R hbar) + c abs(delta), the friction that of
rognon_gay.

An example: exact are the force and the radius at delta >> sqrt(R h), for m << 1 (flat cones); the sum in a is an
interpolation, and the friction is that of a disc of radius a. It is meant for cones that are pressed: abs(delta)
widens a film that is pulled, too, where a real one narrows.
"""

from sympy import Abs, Rational, Symbol, pi, sqrt

from softdyn.derive import DIMENSIONLESS, ContactLaw, E, F, Limit, R, a, delta, eta, h

m = Symbol("m", positive=True)  # slope of the cones' surfaces
c = 2 / (pi * m)  # contact radius by deflection

hbar = R * h / (R + h)  # the smaller of gap and radius, smoothly

law = ContactLaw(
    name="cone",
    description="two blunt elastic cones, tip to tip: a force quadratic in the deflection",
    source="Sneddon, Int. J. Eng. Sci. 3 (1965) 47; friction of arXiv:0803.1573",
    a=sqrt(2 * R * hbar) + c * Abs(delta),
    F_ela=E * a * delta,
    zeta=3 * pi * eta * a**4 / (2 * hbar**3),
    F_adh=0,
    parameters={m: DIMENSIONLESS},
    typical={m: Rational(1, 2)},
    limits=(
        Limit(
            "Stokes",
            order=(delta, R, h),
            claims={
                "a": sqrt(2) * R,
                "zeta": 6 * pi * eta * R,
                "delta": F / (sqrt(2) * E * R),
                "C": E * R / sqrt(2),
                "D": 6 * pi * eta * R,
                "dh_dt": -F / (6 * pi * eta * R),
                "dX_dt": -F / (6 * pi * eta * R),
            },
        ),
        Limit(
            "round tips",
            order=((delta**2, R * h), (h, R)),
            claims={
                "a": sqrt(2 * R * h),
                "zeta": 6 * pi * eta * R**2 / h,
                "delta": F / (E * sqrt(2 * R * h)),
                "C": E * sqrt(R * h / 2),
                "dh_dt": -F * h / (6 * pi * eta * R**2),
            },
        ),
        Limit(
            "cones",
            order=((R * h, delta**2), (delta, R)),
            claims={
                "a": c * delta,
                "zeta": 3 * pi * eta * F**2 * c**2 / (2 * E**2 * h**3),
                "delta": sqrt(F / (c * E)),
                "C": E * c * delta,
                "dh_dt": -2 * E**2 * h**3 / (3 * pi * eta * c**2 * F),
            },
        ),
        Limit(
            "cones, pulled",
            order=((R * h, delta**2), (-delta, R)),
            claims={
                "a": -c * delta,
                "delta": -sqrt(-F / (c * E)),
                "dh_dt": -2 * E**2 * h**3 / (3 * pi * eta * c**2 * F),
            },
        ),
    ),
)
