"""Two equal droplets, or bubbles, held in shape by their surface tension sigma: an effective modulus sigma/R.

Droplets pressed together flatten to a film of radius a, in which the pressure is Laplace's, 2 sigma/R above that of
the fluid around: F = 2 pi sigma a^2/R. A cap of height delta cut off a sphere has a^2 = 2 R delta, and so the force
is a linear spring, F = 4 pi sigma delta, with delta the deflection of one droplet: the convention of Princen, J.
Colloid Interface Sci. 91 (1983) 160, and, up to its constant, of the bubble model of Durian, Phys. Rev. Lett. 75
(1995) 4780. The elastic energy is one of surface, and depends on delta alone: the law is conservative.

Exact to leading order: the film's radius, and thus its drainage, at given F << sigma R; the friction at delta = 0,
which is that of ``equal_spheres``. Not exact: delta itself. Surfaces under a localised force yield further, by a
factor that grows as a logarithm (Morse & Witten, Europhys. Lett. 22 (1993) 549; Lacasse, Grest & Levine, Phys. Rev. E
54 (1996) 5436): about ln(R/h) at delta << h, ln(R/delta) at h << delta; the spring is to be read as an effective one.
In between, and where droplets are pulled and the film narrows, the friction is that of elastic spheres within 12 %
for -2.5 h < delta < 1.5 h (see ``equal_spheres``), with continuous slopes at delta = 0.

The film drains as between rigid discs, zeta = 3 pi eta a^4/(2 h^3) (Reynolds): interfaces that do not flow, as
surfactants make them, and a film of even thickness, without a dimple. Valid for delta << R.
"""

from sympy import Piecewise, Symbol, pi, sqrt

from softdyn.derive import FORCE, LENGTH, ContactLaw, E, F, Limit, R, a, delta, eta, h
from softdyn.derive.rigid_spheres import brenner, unequal

sigma = Symbol("sigma", positive=True)  # surface tension

hbar = 1 / (1 / R + 1 / h)  # the smaller of gap and radius, smoothly; its slope in this form does not cancel

# pressed, the film is wider than that of round spheres; pulled, it is narrower
width = a**2 / (2 * R * hbar)
flattening, narrowing = width**2 - 2 * width + 1, 1 / width**2 - 2 / width + 1
pressed_friction = width + flattening * (1 + 4 * width) / (4 + width)
pulled_friction = 1 / (1 / width + 110 * narrowing / (20 + 9 * narrowing))  # that of equal_spheres

near = 3 * pi * eta * R**2 / (2 * h)
film = 6 * pi * eta * R**2 * delta**2 / h**3
neck = 3 * pi * eta * R**2 / (-2 * delta)

law = ContactLaw(
    name="droplet",
    description="two droplets or bubbles: surface tension as a linear spring, a plane film that drains",
    source="Princen 1983, doi:10.1016/0021-9797(83)90323-5; Reynolds' film; Brenner 1961 for the friction of spheres",
    a=sqrt(2 * R * Piecewise((hbar + delta, delta >= 0), (hbar**2 / (hbar - delta), True))),
    F_ela=4 * pi * sigma * delta,
    zeta=3 * pi * eta * R * brenner * Piecewise((pressed_friction, delta >= 0), (pulled_friction, True)),
    F_adh=0,
    unequal=unequal,
    parameters={sigma: FORCE / LENGTH},
    typical={sigma: E * R},
    limits=(
        Limit(
            "Stokes",
            order=(delta, R, h),
            claims={
                "zeta": 3 * pi * eta * R,
                "delta": F / (4 * pi * sigma),
                "C": 2 * pi * sigma,
                "D": 3 * pi * eta * R,
                "dh_dt": -F / (3 * pi * eta * R),
                "dX_dt": -F / (3 * pi * eta * R),
            },
        ),
        Limit(
            "Poiseuille",
            order=(delta, h, R),
            claims={
                "a": sqrt(2 * R * h),
                "zeta": near,
                "delta": F / (4 * pi * sigma),
                "D": near,
                "dh_dt": -F / near,
                "dX_dt": -F / near,
            },
        ),
        Limit(
            "film",
            order=(h, delta, R),
            claims={
                "a": sqrt(F * R / (2 * pi * sigma)),  # Laplace's pressure over pi a^2 carries F
                "zeta": film,
                "delta": F / (4 * pi * sigma),
                "C": 2 * pi * sigma,
                "D": film,
                "dh_dt": -8 * pi * sigma**2 * h**3 / (3 * eta * R**2 * F),
                "dX_dt": -F / film,
            },
        ),
        Limit(
            "Poiseuille, pulled",
            order=(-delta, h, R),
            claims={"zeta": near, "delta": F / (4 * pi * sigma), "dh_dt": -F / near, "dX_dt": -F / near},
        ),
        Limit(
            "narrow film, pulled",
            order=(h, -delta, R),
            claims={
                "a": sqrt(2 * R / -delta) * h,
                "zeta": neck,
                "delta": F / (4 * pi * sigma),
                "C": 2 * pi * sigma,
                "D": neck,
                "dh_dt": -F / neck,
                "dX_dt": -F / neck,
            },
        ),
    ),
)
