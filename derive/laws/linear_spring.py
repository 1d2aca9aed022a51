"""A linear spring and a dashpot, where two particles overlap: the contact of Cundall & Strack, along its normal.

With the overlap x = 2 delta, F = k x + c dx/dt. Two particles of the reduced mass m = m1 m2/(m1 + m2) that collide are
a damped oscillator for half of a period: with z = c/(2 sqrt(k m)) they part after the time pi sqrt(m/k)/sqrt(1 - z^2),
with exp(-pi z/sqrt(1 - z^2)) of their velocity (the coefficient of restitution), whatever that was. Near the end the
dashpot pulls; that is in this result. k and c are those of the contact, whatever the radii.
"""

from sympy import Symbol, sqrt

from softdyn.derive import FORCE, FRICTION, LENGTH, ContactLaw, E, F, Limit, R, delta, eta

k = Symbol("k", positive=True)  # stiffness, force over overlap
c = Symbol("c", positive=True)  # of the dashpot, force over the rate of the overlap

law = ContactLaw(
    name="linear_spring",
    description="a linear spring and a dashpot where particles overlap: dry grains, and bubbles",
    source="Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47",
    a=sqrt(R * delta),
    F_ela=2 * k * delta,
    zeta=0,
    dashpot=c,
    parameters={k: FORCE / LENGTH, c: FRICTION},
    typical={k: E * R, c: eta * R},
    limits=(Limit("spring", order=(delta, R), claims={"F": 2 * k * delta, "delta": F / (2 * k), "C": k}),),
)
