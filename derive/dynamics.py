"""The dynamics of one contact, derived.

Input: the force balance (eq. 1) and the geometry (eq. 2) of Rognon & Gay, arXiv 0803.1573. Output: the gap dynamics
(eq. 7), the centre dynamics (eq. 9) with its stiffness C and friction D, the rate of the deflection, and the Jacobians,
first for undefined functions a, F_ela, zeta, F_adh, then for a law.

The paper restricts F_ela to (a, delta) and F_adh to (a, h). A law that is declared ``general`` has F_ela(a, delta, h)
and F_adh(a, h, delta): the same derivation is then done for functions of three arguments. With

    F_;h = dF_ela/dh = F_a a_h + F_h ,     F_;delta = dF_ela/d(delta) = F_a a_delta + F_delta

at fixed other state variable, it gives C = F_;delta/2 and D = C zeta/(C + F_;h); eq. 9 stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

from sympy import Derivative, Eq, Expr, Function, Matrix, S, Symbol, cancel, diff, expand

from softdyn.derivations import kept
from softdyn.derive.law import expressions, is_rigid
from softdyn.derive.soundness import sides_of, sound
from softdyn.derive.symbols import F, R, a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

# The partial derivatives, as the paper writes them.
a_h, a_delta = Symbol("a_h", real=True), Symbol("a_delta", real=True)
F_a, F_delta = Symbol("F_a", real=True), Symbol("F_delta", real=True)
# of a general law besides: F_ela may depend on h, F_adh on delta
F_h, F_adh_delta = Symbol("F_h", real=True), Symbol("F_adh_delta", real=True)
F_ah, F_hh, F_hdelta = (Symbol(f"F_{s}", real=True) for s in ("ah", "hh", "hdelta"))
zeta_a, zeta_h = Symbol("zeta_a", real=True), Symbol("zeta_h", real=True)
F_adh_a, F_adh_h = Symbol("F_adh_a", real=True), Symbol("F_adh_h", real=True)
a_hh, a_hdelta, a_deltadelta = (Symbol(f"a_{s}", real=True) for s in ("hh", "hdelta", "deltadelta"))
F_aa, F_adelta, F_deltadelta = (Symbol(f"F_{s}", real=True) for s in ("aa", "adelta", "deltadelta"))

F_ela = Symbol("F_ela", real=True)
F_adh = Symbol("F_adh", real=True)
zeta = Symbol("zeta", positive=True)
C = Symbol("C", positive=True)
D = Symbol("D", positive=True)
dF_dt = Symbol("dF_dt", real=True)
dh_dt = Symbol("dh_dt", real=True)
dX_dt = Symbol("dX_dt", real=True)
ddelta_dt = Symbol("ddelta_dt", real=True)
#: dF_ela/d(delta) at fixed h, which is 2 C, and dF_ela/dh at fixed delta.
dF_ddelta = Symbol("dF_ddelta", positive=True)
dF_dh = Symbol("dF_dh", real=True)

#: What vanishes under the paper's restriction, F_ela(a, delta) and F_adh(a, h).
RESTRICTION: dict[Symbol, Expr] = dict.fromkeys((F_h, F_ah, F_hh, F_hdelta, F_adh_delta), S.Zero)

#: d(symbol)/dh and d(symbol)/d(delta) at fixed other state variable, through a(h, delta).
_TOTAL: dict[Symbol, tuple[Expr, Expr]] = {
    h: (1, 0),
    delta: (0, 1),
    a: (a_h, a_delta),
    F_ela: (F_a * a_h + F_h, F_a * a_delta + F_delta),
    zeta: (zeta_a * a_h + zeta_h, zeta_a * a_delta),
    F_adh: (F_adh_a * a_h + F_adh_h, F_adh_a * a_delta + F_adh_delta),
    a_h: (a_hh, a_hdelta),
    a_delta: (a_hdelta, a_deltadelta),
    F_a: (F_aa * a_h + F_ah, F_aa * a_delta + F_adelta),
    F_delta: (F_adelta * a_h + F_hdelta, F_adelta * a_delta + F_deltadelta),
    F_h: (F_ah * a_h + F_hh, F_ah * a_delta + F_hdelta),
}


def total(expr: Expr, variable: Symbol, general: bool = True) -> Expr:
    """Total derivative of a generic expression with respect to h or delta, through a(h, delta).

    Of a law that is not general, without what vanishes then.

    Parameters
    ----------
    expr : Expr
        In a, h and delta.
    variable : Symbol
        h or delta.
    general : bool
        Whether the law is.
    """
    column = 0 if variable == h else 1
    found = sum((diff(expr, symbol) * rates[column] for symbol, rates in _TOTAL.items()), start=h * 0)
    return found if general else found.subs(RESTRICTION)


@dataclass(frozen=True)
class GenericDynamics:
    """What follows from eqs. 1 and 2 for any law, in the paper's symbols.

    ``X`` is the distance of the centres (eq. 2). ``steps`` are (what was done, the equation that it gave), in order;
    ``lambda1`` = dln(delta)/dln(h) and ``lambda2`` = dln(-dh/dt)/dln(h) are taken at constant force; ``jacobians`` are,
    by state, d(rates)/d(state), with dh_dt and ddelta_dt standing for the rates themselves. ``by_gap`` is dF_ela/dh at
    fixed delta, ``remote_along`` the derivative of F_adh by h along delta(h) at constant force.
    """

    general: bool
    X: Expr
    steps: tuple[tuple[str, Eq], ...]
    by_gap: Expr
    stiffness: Expr
    friction: Expr
    remote_along: Expr
    dh_dt: Expr
    ddelta_dt: Expr
    dX_dt: Expr
    lambda1: Expr
    lambda2: Expr
    jacobians: dict[str, Matrix]

    def _repr_latex_(self) -> str:
        from softdyn.derive.typeset import generic_latex

        return generic_latex(self)


@cache
def generic_dynamics(general: bool = False) -> GenericDynamics:
    """Derive eqs. 7 and 9 from eqs. 1 and 2 by differentiating the force balance.

    Parameters
    ----------
    general : bool
        For F_ela(a, delta, h) and F_adh(a, h, delta), in the place of F_ela(a, delta) and F_adh(a, h).

    Raises
    ------
    AssertionError
        If the result is not the paper's: C = (F_a a_delta + F_delta)/2, D = C zeta/(C + F_a a_h), with F_a a_h + F_h in
        a general law.
    """
    t = Symbol("t", real=True)
    gap, deflection, force = Function("h")(t), Function("delta")(t), Function("F_ext")(t)
    radius = Function("a")(gap, deflection)
    elastic = Function("F_ela")(*((radius, deflection, gap) if general else (radius, deflection)))
    named = {
        **{elastic.fdiff(i): symbol for i, symbol in enumerate((F_a, F_delta, F_h)[: len(elastic.args)], start=1)},
        radius.fdiff(1): a_h,
        radius.fdiff(2): a_delta,
        gap.diff(t): dh_dt,
        deflection.diff(t): ddelta_dt,
        force.diff(t): dF_dt,
    }

    # eq. 1, viscous part: F_ext = -zeta dh/dt + F_adh
    gap_rate = _solved(Eq(F, -zeta * dh_dt + F_adh), dh_dt)
    # eq. 1, elastic part, differentiated: dF_ext/dt = d/dt F_ela(a(h, delta), delta)
    differentiated = Eq(force.diff(t), elastic.diff(t)).subs(named)
    assert not differentiated.atoms(Derivative), f"an unnamed derivative is left in {differentiated}"
    deflection_rate = _solved(differentiated, ddelta_dt)
    # eq. 2, differentiated: X = 2R + h - 2 delta
    distance = 2 * R + h - 2 * delta
    centre_rate = (
        distance.subs({h: gap, delta: deflection})
        .diff(t)
        .subs(named)
        .subs(ddelta_dt, deflection_rate)
        .subs(dh_dt, gap_rate)
    )

    parts = expand(centre_rate)
    compliance = -parts.coeff(dF_dt)
    mobility = -cancel(parts.subs(dF_dt, 0) / (F - F_adh))
    stiffness, friction = 1 / compliance, 1 / mobility
    paper_C = (F_a * a_delta + F_delta) / 2
    by_gap = total(F_ela, h, general)
    paper_D = C * zeta / (C + by_gap)
    assert cancel(stiffness - paper_C) == 0, f"C is not the paper's: {stiffness}"
    assert cancel(friction - paper_D.subs(C, paper_C)) == 0, f"D is not the paper's: {friction}"

    # Jacobians, in terms of the rates themselves: d(dh/dt) and d(d(delta)/dt) by h and by delta
    gap_by = {x: (total(F_adh, x, general) - dh_dt * total(zeta, x)) / zeta for x in (h, delta)}
    by_deflection = total(F_ela, delta)
    deflection_by = {
        x: -(total(by_gap, x, general) * dh_dt + by_gap * gap_by[x] + total(by_deflection, x, general) * ddelta_dt)
        / (2 * C)
        for x in (h, delta)
    }
    # along delta(h) at constant force
    slope = -by_gap / (2 * C)
    gap_along = gap_by[h] + slope * gap_by[delta]
    jacobians = {
        "h, delta": Matrix([[gap_by[h], gap_by[delta]], [deflection_by[h], deflection_by[delta]]]),
        # d(ln h)/dt = (dh/dt)/h and d/d(ln h) = h d/dh
        "ln h, delta": Matrix(
            [[gap_by[h] - dh_dt / h, gap_by[delta] / h], [h * deflection_by[h], deflection_by[delta]]]
        ),
        "ln h, delta from the force balance": Matrix([[gap_along - dh_dt / h]]),
    }
    return GenericDynamics(
        general=general,
        X=distance,
        steps=(
            ("force balance, viscous part", Eq(F, -zeta * dh_dt + F_adh)),
            ("solved for dh/dt (eq. 7)", Eq(dh_dt, gap_rate)),
            ("force balance, elastic part, differentiated", differentiated),
            ("solved for d(delta)/dt", Eq(ddelta_dt, deflection_rate)),
            ("geometry", Eq(Symbol("X"), distance)),
            ("stiffness", Eq(C, paper_C)),
            ("friction", Eq(D, paper_D)),
            ("centre dynamics (eq. 9)", Eq(Symbol("dX_dt"), -dF_dt / C - (F - F_adh) / D)),
        ),
        by_gap=by_gap,
        stiffness=paper_C,
        friction=paper_D,
        remote_along=total(F_adh, h, general) + slope * total(F_adh, delta, general),
        dh_dt=gap_rate,
        ddelta_dt=deflection_rate,
        dX_dt=-dF_dt / C - (F - F_adh) / D,
        lambda1=h / delta * slope,
        lambda2=h * gap_along / dh_dt,
        jacobians=jacobians,
    )


def _solved(equation: Eq, rate: Symbol) -> Expr:
    """Solve an equation that is linear in a rate."""
    difference = expand(equation.rhs - equation.lhs)
    slope, rest = difference.coeff(rate), difference.subs(rate, 0)
    assert expand(slope * rate + rest - difference) == 0, f"{equation} is not linear in {rate}"
    side = -1 if slope.could_extract_minus_sign() else 1
    return expand(-side * rest) / expand(side * slope)


def _derivatives_of_radius(law: ContactLaw, *variables: Symbol) -> list[Expr]:
    """Candidates for a derivative of a: direct, through a^2, simpler for a root; of branches, relative to a^2."""
    square = law.a**2
    direct = diff(law.a, *variables)
    if len(variables) == 1:
        slope = diff(square, *variables)
        relative = [] if sides_of(square) is None else [a * sound(slope / square) / 2]
        return [direct, slope / (2 * a), *relative]
    first, second = variables
    slopes = diff(square, first) / (2 * a) * diff(square, second) / (2 * a)
    return [direct, (diff(square, first, second) / 2 - slopes) / a]


def slope_of_radius(law: ContactLaw, *variables: Symbol) -> Expr:
    """A partial derivative of a, in (a, h, delta), in the form that cancels least."""
    return sound(*_derivatives_of_radius(law, *variables))


def stiffness_of(law: ContactLaw) -> Expr:
    """C = (F_a a_delta + F_delta)/2 of a law, in a, h, delta and the parameters."""
    known = {
        F_a: diff(law.F_ela, a),
        F_delta: diff(law.F_ela, delta),
        a_delta: slope_of_radius(law, delta),
    }
    return sound(generic_dynamics(law.general).stiffness.subs(known))


@lru_cache(maxsize=32)
def partials(law: ContactLaw) -> dict[Symbol, Expr]:
    """Return the declared expressions and their partial derivatives, in (a, h, delta), sound in floating point."""
    return kept("partials", expressions(law), lambda: _partials(law))


def _partials(law: ContactLaw) -> dict[Symbol, Expr]:
    # rigid particles have no elastic force of their own: they transmit any
    elastic = h * 0 if is_rigid(law) else law.F_ela
    return {
        F_ela: sound(elastic),
        F_adh: sound(law.F_adh),
        zeta: sound(law.zeta),
        a_h: slope_of_radius(law, h),
        a_delta: slope_of_radius(law, delta),
        a_hh: slope_of_radius(law, h, h),
        a_hdelta: slope_of_radius(law, h, delta),
        a_deltadelta: slope_of_radius(law, delta, delta),
        F_a: sound(diff(elastic, a)),
        F_delta: sound(diff(elastic, delta)),
        F_aa: sound(diff(elastic, a, a)),
        F_adelta: sound(diff(elastic, a, delta)),
        F_deltadelta: sound(diff(elastic, delta, delta)),
        F_h: sound(diff(elastic, h)),
        F_ah: sound(diff(elastic, a, h)),
        F_hdelta: sound(diff(elastic, h, delta)),
        F_hh: sound(diff(elastic, h, h)),
        zeta_a: sound(diff(law.zeta, a)),
        zeta_h: sound(diff(law.zeta, h)),
        F_adh_a: sound(diff(law.F_adh, a)),
        F_adh_h: sound(diff(law.F_adh, h)),
        F_adh_delta: sound(diff(law.F_adh, delta)),
    }


def by_gap_of(law: ContactLaw) -> Expr:
    """Return dF_ela/dh at fixed delta of a law, in a, h, delta and the parameters."""
    return sound(generic_dynamics(law.general).by_gap.subs(partials(law)))


def lambda1_of(law: ContactLaw, stiffness: Expr) -> Expr:
    """Return dln(delta)/dln(h) at constant force, in terms of 2 C as given."""
    values = partials(law)
    # F_a/delta and F_h/delta are finite at delta = 0 wherever the deflection starts linearly
    over_delta = {symbol: (values[symbol] / delta).cancel() for symbol in (F_a, F_h)}
    return -h * sound(generic_dynamics(law.general).by_gap.subs({**values, **over_delta})) / stiffness
