"""Two equal elastic spheres in a viscous fluid, with the constants of two equal spheres.

The structure is that of Rognon & Gay, arXiv 0803.1573 (law ``rognon_gay``), whose friction near contact is that of a
sphere and a plane, and whose constants are not Hertz's. Exact here, to leading order:

- friction at delta = 0, by a closed fit to the series of Brenner, Chem. Eng. Sci. 16 (1961) 242, within 0.7 % for h/R
  from 1e-4 to 1e2, with the exact leading terms on both ends: (3/2) pi eta R^2/h and 3 pi eta R; and of unequal ones
  and walls, in scenes of many, by a factor that is as good (see :mod:`softdyn.derive.rigid_spheres`);
- elasticity at h << delta: Hertz, F = (4/3) E/(1 - nu^2) a delta with a = sqrt(R delta) (Johnson, Contact Mechanics,
  1985, ch. 4; delta is the deflection of one sphere);
- elasticity at delta << h << R: lubrication pressure, (1 + r^2/(R h))^-2, on two half-spaces deflects their centres
  by (1 - nu^2) F/(2 E sqrt(R h)), which is the same expression with a = (3/2) sqrt(R h). The next term in delta/h,
  3/8 in a^2/(R h), is that of a constant force (0.3728 by quadrature);
- friction at h << delta << R: the film drains at its centre under Hertz's pressure, dh/dt = -h^3 F/(4 pi eta a^4),
  which is 0.375 of the rate between parallel discs of that radius.

In between, and where surfaces are pulled apart, a and zeta are fits to elastohydrodynamics (Reynolds' equation and an
elastic half-space; table and solver are in the repository): friction within 12 % and elastic radius within 10 % for
-2.5 h < delta < 1.5 h at h << R. Pulled surfaces bulge towards each other: the film narrows, and its friction falls
below that of rigid spheres, while suction around it holds the surfaces no less stiffly. Force and friction have
continuous slopes at delta = 0, and D > 0 on both sides; the radius a of the film has a kink there. The first correction
of the friction, 1 + delta/h, lies between that of surfaces held in their deflected shape, 0.80, and of a constant
force, 1.51 (both by quadrature). Films have memory that no law of h and delta has: pressed and then pulled, their
centre goes on closing while the rim opens. At h << -delta the law is an extrapolation. Nothing is claimed of the
elasticity beyond h ~ R, where delta/R ~ F/(E R^2) up to a constant; D at h << delta follows from the fit.

Tangential motion, in scenes that ask for it: the leading terms, ln(R/h), of the functions Y^A, Y^B and Y^C of Jeffrey &
Onishi, J. Fluid Mech. 139 (1984) 261, of rigid unequal spheres, R = 2 R1 R2/(R1 + R2), in series with Mindlin's
stiffness, 2 (1 - nu)/(2 - nu) of the normal one where Hertz's law holds (Johnson 1985, sec. 7.2). A flattened film, of
the radius a and the thickness h, adds its own pi eta a^2/h. In between and for the stiffness at delta << h these are
estimates; rolling is that of rigid spheres.

Valid for delta << R, which Hertz's law and half-spaces suppose, in Stokes flow, for no-slip surfaces, and for the
Poisson ratios of isotropic solids, -1 < nu <= 1/2; most soft solids are incompressible, nu = 1/2.
"""

from sympy import Interval, Piecewise, Rational, Symbol, log, pi, sqrt

from softdyn.derive import DIMENSIONLESS, ContactLaw, E, F, Limit, R, Tangential, a, delta, eta, h, size_ratio
from softdyn.derive.rigid_spheres import brenner, unequal

nu = Symbol("nu", real=True)  # Poisson's ratio

hbar = 1 / (1 / R + 1 / h)  # the smaller of gap and radius, smoothly; its slope in this form does not cancel
a0 = Rational(3, 2) * sqrt(R * hbar)  # the radius at delta = 0
modulus = E / (1 - nu**2)  # of plane strain

# pressed, the film is wider than that of round spheres; pulled, it is narrower, and suction around it holds surfaces
pressed_film = R * (hbar + delta + 5 * hbar**2 / (2 * (2 * hbar + delta)))
pulled_film = a0**2 * hbar / (hbar - delta)
pulled_radius = sqrt(5 * a**2 - 4 * R * delta) / sqrt(5)

width = (a / a0) ** 2  # of the film, as an area, over that of round spheres
pressed_friction = 54 * width**2 / (4 + 21 / width**2 + 29 / width**6)
narrowing = 1 / width**2 - 2 / width + 1
pulled_friction = 1 / (1 / width + 110 * narrowing / (20 + 9 * narrowing))

# what a film adds to sliding, as its area, and takes away where it narrows; and the radius that is sheared
flat = Piecewise((a**2 - a0**2, delta >= 0), (a0**2 * (width - 1) / (3 * (width + 1)), True))
sheared = Piecewise((a, delta >= 0), (12 * a0 / (11 + 1 / width), True))
shear = pi * eta * R * log(1 + R / h)  # sliding of rigid equal spheres at h << R; log as it vanishes at large gaps

near = 3 * pi * eta * R**2 / (2 * h)
film = 4 * pi * eta * R**2 * delta**2 / h**3
neck = 3 * pi * eta * R**2 / (-2 * delta)

law = ContactLaw(
    name="equal_spheres",
    description="two equal elastic spheres with their true constants: Brenner's friction, Hertz's force, drainage",
    source="Brenner 1961, doi:10.1016/0009-2509(61)80035-3; Hertz (Johnson 1985, ch. 4); structure of arXiv:0803.1573",
    a=sqrt(Piecewise((pressed_film, delta >= 0), (pulled_film, True))),
    F_ela=Rational(4, 3) * modulus * delta * Piecewise((a, delta >= 0), (pulled_radius, True)),
    zeta=3 * pi * eta * R * brenner * Piecewise((pressed_friction, delta >= 0), (pulled_friction, True)),
    F_adh=0,
    unequal=unequal,
    tangential=Tangential(
        sliding=Rational(4, 5) * (2 - 3 * size_ratio) * shear + pi * eta * flat / h,
        coupling=Rational(3, 5) * R * shear,
        rolling=Rational(3, 5) * R**2 * shear,
        k_t=2 * E * sheared / ((1 + nu) * (2 - nu)),
    ),
    parameters={nu: DIMENSIONLESS},
    ranges={nu: Interval.Lopen(-1, Rational(1, 2))},
    typical={nu: Rational(1, 2)},
    limits=(
        Limit(
            "Stokes",
            order=(delta, R, h),
            claims={
                "a": 3 * R / 2,
                "zeta": 3 * pi * eta * R,
                "delta": F / (2 * modulus * R),
                "C": modulus * R,
                "D": 3 * pi * eta * R,
                "dh_dt": -F / (3 * pi * eta * R),
                "dX_dt": -F / (3 * pi * eta * R),
            },
        ),
        Limit(
            "Poiseuille",
            order=(delta, h, R),
            claims={
                "a": 3 * sqrt(R * h) / 2,
                "zeta": near,
                "delta": F / (2 * modulus * sqrt(R * h)),
                "C": modulus * sqrt(R * h),
                "D": near,
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        Limit(
            "Hertz",
            order=(h, delta, R),
            claims={
                "a": sqrt(R * delta),
                "zeta": film,
                "delta": (3 * F / (4 * modulus * sqrt(R))) ** Rational(2, 3),
                "C": modulus * sqrt(R * delta),
                "D": Rational(3, 5) * film,
                "dh_dt": -F / film,
                "dX_dt": Rational(-5, 3) * F / film,
            },
        ),
        Limit(
            "Stokes, pulled",
            order=(-delta, R, h),
            claims={
                "a": 3 * R / 2,
                "zeta": 3 * pi * eta * R,
                "delta": F / (2 * modulus * R),
                "D": 3 * pi * eta * R,
                "dh_dt": -F / (3 * pi * eta * R),
                "dX_dt": -F / (3 * pi * eta * R),
            },
        ),
        Limit(
            "Poiseuille, pulled",
            order=(-delta, h, R),
            claims={
                "a": 3 * sqrt(R * h) / 2,
                "zeta": near,
                "delta": F / (2 * modulus * sqrt(R * h)),
                "C": modulus * sqrt(R * h),
                "D": near,
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        Limit(
            "narrow film, pulled",
            order=(h, -delta, R),
            claims={
                "a": 3 * sqrt(R / -delta) * h / 2,
                "zeta": neck,
                "delta": -((-3 * sqrt(5) * F / (8 * modulus * sqrt(R))) ** Rational(2, 3)),
                "C": modulus * sqrt(-4 * R * delta / 5),
                "D": neck,
                "dh_dt": -F / neck,
                "dX_dt": -F / neck,
            },
        ),
    ),
)
