"""Tangential motion of a contact: one implicit stage of its force, at a given sliding of the surfaces.

**Film.** Two rigid spheres near contact, of radii R1 and R2, normal n from 1 to 2. Let u be the velocity of surface 1
relative to surface 2 along the film, and w = (omega1 - omega2) x n that of rolling. The film takes a force T from 1 to
2 and a moment M, both linear in u and w, by a symmetric matrix (Lorentz's theorem)::

    T = A u + D B w ,     M = D B u + G w ,     D = (R1 - R2)/(R1 + R2)

B changes sign as 1 and 2 change places: hence D. Nothing else can appear: a rigid motion of both makes u = w = 0. The
functions Y^A, Y^B, Y^C of Jeffrey & Onishi (1984), with their leading terms at xi -> 0, are this with, in units of
pi eta ln(1/xi) and with Re = R1 R2/(R1 + R2) = R/2, s = Re/(R1 + R2),

    A = (8/5) Re (2 - 3 s) ,     B = (12/5) Re^2 ,     G = (24/5) Re^3

Y^A is A, Y^B_11 is A R1 + D B, Y^C_11 is A R1^2 + 2 D B R1 + G, Y^C_12 is A R1 R2 + D B (R2 - R1) - G, each in the
units of that paper: four functions of R1/R2 from three. Rotation about n has no singular resistance.

**Surfaces.** They give in to T by T/k_t: u is the sliding of the bodies less that, a Maxwell element in series. The
rate of T is taken in the frame that turns with n and spins with (omega1 + omega2).n/2, so that nothing depends on who
looks. With the sliding sigma of the bodies, eliminating u from T and M leaves::

    dT/dt / k_t + T/A = sigma + (D B/A) w ,     M = (D B/A) T + (G - D^2 B^2/A) w

That is sliding at a point of contact which is moved along n by the lever e = B/A times D: the levers are b1 = l1 + D e
and b2 = l2 - D e, and rolling is resisted by the rest of G alone. The film's middle divides the distance of the
centres, l_i = R_i + (r - R1 - R2)/2, for a wall too; b1 + b2 = r, so that torques balance exactly and a rigid
rotation does not slide.

**Stage.** With s = gamma dt, the slip s (sigma + (D B/A) w), what is known T* of T, and all resistances of the film
times its weight w(h), the stage T = T* + s dT/dt is::

    T = keep T* + stiff slip ,     keep = w A/(w A + s k_t) ,     stiff = k_t keep

As k_t -> oo this is T = w A sigma, as s -> 0 it is elastic, and at the range, w = 0, T = 0: no jump. h, and with it a,
A, k_t and the rest follow the distance r of the centres by the contact's own equation, so that the tangent has two
parts: stiff along the slip, and (dkeep/dr) T* + (dstiff/dr) slip along n, which makes the matrix unsymmetric.

**Energy.** What slides puts in T (sigma + (D B/A) w) = T^2/(w A) + d(T^2/(2 k_t))/dt + T^2 (dk_t/dt)/(2 k_t^2): lost,
stored, and taken by a change of the stiffness; the last is, as the U_h term of F_ela, not that of a conservative law.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from sympy import Eq, Expr, Symbol, collect, diff, expand, simplify, solve

from softdyn.derive.dynamics import a_delta, a_h
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import a, h, size_ratio

if TYPE_CHECKING:
    from softdyn.derive.law import Tangential

# of the contact's stage: gamma dt, the weight of the film with its slope, and dh/dr along the contact's equation
s, w = Symbol("s", positive=True), Symbol("w", nonnegative=True)
w_h, h_r = Symbol("w_h", real=True), Symbol("h_r", real=True)

# A, B, G without the weight, w A, and the stiffness
A, B, G = Symbol("sliding", positive=True), Symbol("coupling", real=True), Symbol("rolling", real=True)
A_w, k_t = Symbol("friction_t", nonnegative=True), Symbol("k_t", positive=True)
keep, stiff, roll, lever = (Symbol(name, real=True) for name in ("keep", "stiff", "roll", "lever"))
#: What the kernel gives of tangential motion, and the derivatives of each along r.
OUTPUTS = (keep, stiff, roll, lever)
ALONG = {symbol: Symbol(f"{symbol.name}_r", real=True) for symbol in (*OUTPUTS, A, B, G, A_w, k_t)}
PARTS = (A, B, G, k_t)
OF_H = {symbol: Symbol(f"{symbol.name}_h", real=True) for symbol in PARTS}
OF_DELTA = {symbol: Symbol(f"{symbol.name}_delta", real=True) for symbol in PARTS}
#: What ``state`` reports of tangential motion: friction w A, rolling, stiffness with its slopes in h and delta.
STATE_OUTPUTS = (A_w, roll, k_t, OF_H[k_t], OF_DELTA[k_t])


@cache
def stage() -> dict[Symbol, Expr]:
    """Derive the stage of the tangential force and its derivatives along r, for any law.

    Returns
    -------
    dict
        In terms of the declared A, B, G, k_t, their slopes in h and delta, the weight, and dh/dr.

    Raises
    ------
    AssertionError
        If the forms that the kernel computes are not the solution of the equation, or not its derivatives.
    """
    T, T_star, slip = (Symbol(name, real=True) for name in ("T", "T_star", "slip"))
    (solved,) = solve(Eq(T, T_star + k_t * (slip - s * T / A_w)), T)
    kept = A_w / (A_w + s * k_t)
    assert simplify(solved - (kept * T_star + k_t * kept * slip)) == 0, "the stage of the tangential force is wrong"

    # the film's matrix, with u eliminated: M = lever T + rest w
    u, turn, D = (Symbol(name, real=True) for name in ("u", "turn", "D"))
    sliding = solve(Eq(T, A * u + D * B * turn), u)[0]
    moment = D * B * sliding + G * turn
    squared = 1 - 4 * size_ratio  # D^2
    rest = G - squared * B**2 / A
    assert simplify(moment - D * B / A * T - rest.subs(squared, D**2) * turn) == 0, "the moment of rolling is wrong"

    forms: dict[Symbol, Expr] = {
        A_w: w * A,
        keep: kept,
        stiff: k_t * keep,
        roll: w * rest,
        lever: B / A,
    }
    slopes: dict[Symbol, Expr] = {
        # delta = (overlap + h)/2 falls by half of r and rises by half of h
        **{ALONG[x]: OF_H[x] * h_r + OF_DELTA[x] * (h_r - 1) / 2 for x in PARTS},
        ALONG[A_w]: w * ALONG[A] + w_h * h_r * A,
        # 1/(w A + s k_t) does not vanish where w does
        ALONG[keep]: s * (k_t * ALONG[A_w] - A_w * ALONG[k_t]) / (A_w + s * k_t) ** 2,
        ALONG[stiff]: ALONG[k_t] * keep + k_t * ALONG[keep],
        ALONG[lever]: (ALONG[B] - lever * ALONG[A]) / A,
        ALONG[roll]: w * (ALONG[G] - squared * lever * (2 * ALONG[B] - lever * ALONG[A])) + w_h * h_r * rest,
    }

    def along(expr: Expr) -> Expr:
        """Derivative by r along the contact's equation."""
        inner = sum((diff(expr, x) * along(forms[x]) for x in expr.free_symbols & set(forms)), start=h * 0)
        return inner + sum((diff(expr, x) * ALONG[x] for x in PARTS), start=h * 0) + diff(expr, w) * w_h * h_r

    for symbol, form in forms.items():
        difference = (slopes[ALONG[symbol]] - along(form)).subs(slopes).subs(lever, B / A).subs(keep, kept)
        assert simplify(difference.subs(slopes).subs(A_w, w * A)) == 0, f"the slope of {symbol} is wrong"
    return {**forms, **slopes}


@cache
def motion() -> list[tuple[str, Eq]]:
    """Derive what any law's tangential motion obeys, without the weight of the film, as its derivation shows it."""
    T, M, u, turn, slide, dT_dt = (Symbol(name, real=True) for name in ("T", "M", "u", "w", "sigma", "dT_dt"))
    R1, R2 = Symbol("R1", positive=True), Symbol("R2", positive=True)
    D = Symbol("D", real=True)
    force, moment, surfaces = Eq(T, A * u + D * B * turn), Eq(M, D * B * u + G * turn), Eq(u, slide - dT_dt / k_t)
    film = solve(force, u)[0]
    (rate,) = solve(Eq(film, surfaces.rhs), dT_dt)
    (given,) = solve(moment.subs(u, film), M)
    steps = [
        ("radii of the pair", Eq(size_ratio, R1 * R2 / (R1 + R2) ** 2)),
        ("film: force on surfaces that slide at u and roll at w = (omega1 - omega2) x n", force),
        ("film: moment", moment),
        ("surfaces in series with it, where the bodies slide at sigma", surfaces),
        ("solved for dT/dt, in the frame that turns with the pair", Eq(dT_dt, expand(rate))),
        ("moment at that force", Eq(M, collect(expand(given), (T, turn)))),
    ]
    return [(text, step.subs(D, (R1 - R2) / (R1 + R2))) for text, step in steps]


def tangential_definitions(tangential: Tangential) -> dict[Symbol, Expr]:
    """The declared expressions of a law, their slopes, and the stage, each in terms of earlier ones."""
    declared = {A: tangential.sliding, B: tangential.coupling, G: tangential.rolling, k_t: tangential.k_t}
    # through a(h, delta)
    by_h = {OF_H[x]: sound(diff(expr, h) + diff(expr, a) * a_h) for x, expr in declared.items()}
    by_delta = {OF_DELTA[x]: sound(diff(expr, a) * a_delta) for x, expr in declared.items()}
    return {**{x: sound(expr) for x, expr in declared.items()}, **by_h, **by_delta, **stage()}
