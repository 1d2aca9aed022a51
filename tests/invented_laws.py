"""Laws that no paper holds, each with something that the stock law lacks."""

from __future__ import annotations

from sympy import Abs, Max, Min, Piecewise, Rational, Symbol, exp, pi, sqrt, tanh

from softdyn.derive import DIMENSIONLESS, FORCE, LENGTH, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.laws.rognon_gay import law as rognon_gay

hbar = R * h / (R + h)

A = Symbol("strength", real=True)
ell = Symbol("ell", positive=True)
#: A remote force that decays with the gap; its sign is free.
screened = ContactLaw(
    name="screened",
    a=sqrt(2 * R * (hbar + Abs(delta))),
    F_ela=Rational(4, 9) * E * a * delta,
    zeta=3 * pi * eta * a**4 / (2 * hbar**3),
    F_adh=A * exp(-h / ell),
    parameters={A: FORCE, ell: LENGTH},
)

tilt = Symbol("tilt", positive=True)
#: a grows linearly with the deflection: a is no square root, and has a kink.
cone = ContactLaw(
    name="cone",
    a=sqrt(2 * R * hbar) + tilt * Abs(delta),
    F_ela=E * a * delta,
    zeta=6 * pi * eta * a**4 / h**3,
    parameters={tilt: DIMENSIONLESS},
)

b = Symbol("rim", positive=True)
#: A rim of fixed width b that knows nothing of R; a remote force that acts on the area pi a^2; broken powers.
rimmed = ContactLaw(
    name="rimmed",
    a=b + sqrt(R * h) + sqrt(b**2 + delta**2),
    F_ela=E * a ** Rational(1, 3) * delta * (b + Abs(delta)) ** Rational(2, 3) + E * a * delta,
    zeta=eta * a**2 * (a / h) ** Rational(5, 4) / (a + h),
    F_adh=E * a**2 * tanh(b / h) / 100,
    parameters={b: LENGTH},
)

s = Symbol("brush", positive=True)
#: Branches: a brush of length s, touched below h = 2 s, a spring stiffer in compression, a friction with a floor.
branched = ContactLaw(
    name="branched",
    a=sqrt(2 * R * h + delta**2),
    F_ela=E * a * delta + Piecewise((E * delta**2, delta > 0), (0, True)),
    zeta=eta * a * Max(R / h, 1) + eta * Min(a, R),
    F_adh=Piecewise(
        (E * s**2 * ((2 * s / h) ** Rational(9, 4) - (h / (2 * s)) ** Rational(3, 4)), h < 2 * s), (0, True)
    ),
    parameters={s: LENGTH},
)

t, k, W = Symbol("thickness", positive=True), Symbol("softness", positive=True), Symbol("work", positive=True)
#: A layer of thickness t on each particle stiffens the contact as the gap closes; the remote force of Maugis, which
#: acts where the surfaces are near, knows the deflection.
layered = ContactLaw(
    name="layered",
    a=sqrt(2 * R * (hbar + Abs(delta))),
    F_ela=Rational(4, 9) * E * a * delta * (1 + k * t / (t + h)),
    zeta=3 * pi * eta * a**4 / (2 * hbar**3),
    F_adh=-pi * W * R * exp(-h / ell) * (1 + delta**2 / (R * ell + delta**2)),
    parameters={t: LENGTH, k: DIMENSIONLESS, W: FORCE / LENGTH, ell: LENGTH},
    typical={t: R / 10, k: Rational(1, 2), W: E * R / 10**4, ell: R / 100},
    general=True,
)

#: As JKR's: a rim attracts with sqrt(8 pi W E a^3), here as far as ell, and there is a force at delta = 0.
sticky = ContactLaw(
    name="sticky",
    a=sqrt(R * hbar + b**2),
    F_ela=2 * E * a * delta + Rational(2, 3) * E * delta**3 / a - sqrt(8 * pi * W * E * a**3) * exp(-h / ell),
    zeta=3 * pi * eta * a**4 / (2 * hbar**3),
    parameters={b: LENGTH, W: FORCE / LENGTH, ell: LENGTH},
    typical={b: R / 10, W: E * R / 10**4, ell: R / 100},
    general=True,
)

LAWS = {law.name: law for law in (rognon_gay, screened, cone, rimmed, branched)}
#: Beyond the paper's restriction.
GENERAL = {law.name: law for law in (layered, sticky)}
