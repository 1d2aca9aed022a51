"""Two elastic spheres with internal friction: Hertz's contact as a solid of Kelvin and Voigt, dry.

Stresses in a solid that creeps a little are those of the strain at a time that is ahead by a time tau, a property of
the material alone: F = F_ela(delta + tau d(delta)/dt), and to first order in tau the dashpot beside Hertz's force is
tau dF_ela/dx, x = 2 delta the overlap (Kuwabara & Kono, Jpn. J. Appl. Phys. 26 (1987) 1230; Brilliantov, Spahn,
Hertzsch & Poschel, Phys. Rev. E 53 (1996) 5382). It vanishes where surfaces just touch, and the coefficient of
restitution tends to 1 as the velocity of the collision tends to 0, as v^(1/5).

Without it a collision at the velocity v lasts 2.8683 (m^2/(R* E*^2 v))^(1/5), with the reduced mass m, the radius
R* = R/2 and E* = E/(2 (1 - nu^2)) (Johnson, Contact Mechanics, 1985, sec. 11.4).
"""

from sympy import Interval, Rational, Symbol, oo, sqrt

from softdyn.derive import DIMENSIONLESS, TIME, ContactLaw, E, F, Limit, R, Tangential, a, delta, eta

nu = Symbol("nu", real=True)  # Poisson's ratio
tau = Symbol("tau", positive=True)  # by how much stresses are ahead of strains

modulus = E / (1 - nu**2)

law = ContactLaw(
    name="hertz",
    description="two elastic spheres with internal friction, dry: Hertz's force and a dashpot that grows with it",
    source="Hertz (Johnson 1985, ch. 4); Kuwabara & Kono 1987, doi:10.1143/JJAP.26.1230",
    a=sqrt(R * delta),
    F_ela=Rational(4, 3) * modulus * a * delta,
    zeta=0,
    dashpot=tau * modulus * a,
    # where both surfaces stick: Mindlin's 8 G* a, see hertz_dry
    tangential=Tangential(sliding=oo, k_t=2 * E * a / ((1 + nu) * (2 - nu))),
    parameters={nu: DIMENSIONLESS, tau: TIME},
    ranges={nu: Interval.Lopen(-1, Rational(1, 2))},
    typical={nu: Rational(1, 2), tau: eta / E},
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
