"""Two droplets or bubbles with a short-range repulsion: the black films of soaps and emulsions.

The disjoining pressure Pi0 exp(-h/ell) acts over the whole film, of area 2 pi R delta as ``droplet`` has it, and, by
Derjaguin's approximation, over the curved rim around it, which counts as pi R ell::

    F_adh = pi Pi0 exp(-h/ell) (2 R delta + R ell)       2 R delta = a^2 - 2 R hbar

It is this growing area, not that of round spheres, that makes a film what it is: pressed with F >> sigma ell it
settles where the disjoining pressure is Laplace's, Pi0 exp(-h/ell) = 2 sigma/R, at a thickness that does not depend
on the force (Bergeron, J. Phys.: Condens. Matter 11 (1999) R215). For a smaller force it is Derjaguin's between
spheres, pi R Pi0 ell exp(-h/ell) = F.

Exact: the integral over a plane film and a parabolic rim, h << R. One exponential stands for the repulsion of charged
surfactants (Pi0 and ell as in ``dlvo``) or of their heads; no attraction. Elasticity, friction and their limits of
validity are those of ``droplet``; in tension there is no plane film, and the rim is as steep as the narrowed film is.

Typical: bubbles or drops of R = 100 um, sigma = 30 mN/m (E stands for sigma/R = 300 Pa), ell = 10 nm (1 mM salt), Pi0
= 100 kPa: a common black film, h = 5.1 ell = 51 nm.
"""

from sympy import Piecewise, Symbol, exp, pi

from softdyn.derive import LENGTH, PRESSURE, ContactLaw, E, F, Limit, R, a, delta, eta, h
from softdyn.derive.laws.droplet import film, hbar, near, sigma
from softdyn.derive.laws.droplet import law as droplet

Pi0 = Symbol("Pi0", positive=True)  # disjoining pressure, extrapolated to contact
ell = Symbol("ell", positive=True)  # its range

round_film = pi * R * Pi0 * ell  # Derjaguin's repulsion of spheres, extrapolated to contact
# over pi: of the plane film and its rim; of a rim alone that pulled surfaces make steeper, as a^2 tells
area = Piecewise((a**2 - 2 * R * hbar + R * ell, delta >= 0), (a**2 * ell / (2 * hbar), True))

law = ContactLaw(
    name="soap_film",
    description="droplet with an exponential disjoining pressure: black films",
    source="Bergeron 1999, doi:10.1088/0953-8984/11/19/201; droplet",
    a=droplet.a,
    F_ela=droplet.F_ela,
    zeta=droplet.zeta,
    F_adh=pi * Pi0 * exp(-h / ell) * area,
    unequal=droplet.unequal,
    parameters={**droplet.parameters, Pi0: PRESSURE, ell: LENGTH},
    typical={**droplet.typical, Pi0: 333 * E, ell: R / 10**4},
    limits=(
        Limit(
            "Poiseuille",
            # the rim's repulsion is less than the force, and the plane film's pressure less than Laplace's
            order=((delta, h, R), (ell, h), (round_film * exp(-h / ell), F), (Pi0 * R * exp(-h / ell), sigma)),
            claims={"zeta": near, "delta": F / (4 * pi * sigma), "dh_dt": -F / near, "dX_dt": -F / near},
        ),
        Limit(
            "film, draining",
            order=((h, delta, R), (ell, h)),
            claims={
                "zeta": film,
                "delta": F / (4 * pi * sigma),
                "dh_dt": -8 * pi * sigma**2 * h**3 / (3 * eta * R**2 * F),
            },
        ),
        Limit(
            "round, repelled",
            order=(delta, h, ell, R),
            claims={"F_adh": round_film, "dh_dt": 2 * Pi0 * ell * h / (3 * eta * R)},
        ),
        Limit(
            "film, repelled",
            order=((h, ell, delta, R), (sigma, Pi0 * R)),
            claims={"F_adh": 2 * pi * R * Pi0 * delta, "dh_dt": Pi0 * h**3 / (3 * eta * R * delta)},
        ),
    ),
)
