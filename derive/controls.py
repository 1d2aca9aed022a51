"""What a kernel computes of a contact under each control, in forms that are right in floating point.

Input: the dynamics derived for any law (:mod:`softdyn.derive.dynamics`). Output: D, the rates, the exponents and the
slopes of the rates, each in terms of a few slopes of the law, for three ways to drive a contact: by the force, by
moving the centres through a spring of compliance 1/k (0 where they are moved themselves), and, of rigid particles, by
the force on the gap alone.

Every form stands here once, and is asserted to be what the derivation gives: no kernel has a formula of its own. They
differ from the derived ones in this: the friction enters by its relative slopes, which neither overflow nor cancel
where zeta does, and the elastic force by its slopes at fixed gap or deflection.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING

from sympy import Eq, Expr, S, Symbol, diff, expand, fraction, limit, oo, solve, together

from softdyn.derive.dynamics import (
    C,
    D,
    F_adh,
    F_ela,
    ddelta_dt,
    dF_ddelta,
    dF_dh,
    dF_dt,
    dh_dt,
    dX_dt,
    generic_dynamics,
    partials,
    total,
    zeta,
)
from softdyn.derive.equations import with_known
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import F, R, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

X = Symbol("X", real=True)
lambda1, lambda2 = Symbol("lambda1", real=True), Symbol("lambda2", real=True)
#: The rate of X where it is an outcome: of a spring, whose base has the velocity dX_dt.
centres_rate = Symbol("dX_dt_p1", real=True)
#: d(d(ln h)/dt)/d(ln h) and the other entries of the Jacobian of the state's rates; their names, like those of powers,
#: are none that a parameter can have.
SLOPES = tuple(Symbol(f"slope_p{entry}", real=True) for entry in ("11", "12", "21", "22"))
#: d(d(ln h)/dt)/dF at fixed gap, the deflection following from the force balance.
BY_FORCE = Symbol("by_force_p1", real=True)
#: 1/k of the spring that moves the centres: 0 where their velocity itself is given.
compliance = Symbol("compliance_p1", nonnegative=True)

# slopes of a law, of which the forms are made: of ln zeta, of F_adh, and of the two slopes of F_ela
log_zeta_h, log_zeta_delta = Symbol("log_zeta_h", real=True), Symbol("log_zeta_delta", real=True)
remote_h, remote_delta = Symbol("remote_h", real=True), Symbol("remote_delta", real=True)
dF_dh_h, dF_dh_delta = Symbol("dF_dh_h", real=True), Symbol("dF_dh_delta", real=True)
dF_ddelta_h, dF_ddelta_delta = Symbol("dF_ddelta_h", real=True), Symbol("dF_ddelta_delta", real=True)


def slopes_of_any_law() -> dict[Symbol, Expr]:
    """Return these slopes in the derivation's symbols."""
    generic = generic_dynamics(general=True)
    along_h, along_delta = generic.by_gap, 2 * generic.stiffness
    return {
        dF_dh: along_h,
        dF_ddelta: along_delta,
        log_zeta_h: total(zeta, h) / zeta,
        log_zeta_delta: total(zeta, delta) / zeta,
        remote_h: total(F_adh, h),
        remote_delta: total(F_adh, delta),
        dF_dh_h: total(along_h, h),
        dF_dh_delta: total(along_h, delta),
        dF_ddelta_h: total(along_delta, h),
        dF_ddelta_delta: total(along_delta, delta),
    }


def slopes_of(law: ContactLaw, forms: Iterable[Expr]) -> dict[Symbol, Expr]:
    """Return those that forms are made of, for a law, sound in floating point; a kernel names those of F_ela itself."""
    values, needed = partials(law), set().union(*(form.free_symbols for form in forms)) - {dF_dh, dF_ddelta}
    return {symbol: sound(with_known(expr, values)) for symbol, expr in slopes_of_any_law().items() if symbol in needed}


@cache
def rates() -> dict[Symbol, Expr]:
    """D and the rates, in C, the slopes of F_ela, zeta and the forces."""
    generic = generic_dynamics(general=True)
    forms = {
        D: C * zeta / (C + dF_dh),
        dh_dt: -(F - F_adh) / zeta,
        ddelta_dt: (dF_dt - dF_dh * dh_dt) / dF_ddelta,
        dX_dt: -dF_dt / C - (F - F_adh) / D,
    }
    derived = {D: generic.friction, dh_dt: generic.dh_dt, ddelta_dt: generic.ddelta_dt, dX_dt: generic.dX_dt}
    return _proved(forms, derived)


def _of_state(expr: Expr, gap_rate: Expr, deflection_rate: Expr) -> Expr:
    """Rate of what is made of h and delta."""
    return diff(expr, h) * gap_rate + diff(expr, delta) * deflection_rate


def _proved(
    forms: dict[Symbol, Expr], derived: Mapping[Symbol, Expr], rate_of: Mapping[Symbol, Expr] = {}
) -> dict[Symbol, Expr]:
    """Return forms that are equal to what is derived.

    Raises
    ------
    AssertionError
        If one of them is not.
    """
    generic = generic_dynamics(general=True)
    known = slopes_of_any_law()
    for symbol, form in forms.items():
        difference = form - derived[symbol]
        if F in difference.free_symbols:  # the derived form has dh/dt where this one has the forces
            difference = difference.subs(dh_dt, generic.dh_dt)
        difference = difference.subs(rate_of).subs(C, generic.stiffness).subs(known)
        assert expand(fraction(together(difference))[0]) == 0, f"{symbol} is not what is derived: {form}"
    return forms


def _by_gap_and_deflection(variable: Symbol) -> tuple[Expr, Expr, Expr]:
    """Slopes by h or by delta, at the other fixed: of ln zeta, of F_adh, and of F_ela."""
    return (log_zeta_h, remote_h, dF_dh) if variable == h else (log_zeta_delta, remote_delta, dF_ddelta)


@cache
def by_force() -> dict[Symbol, Expr]:
    """Exponents and slopes where the force is given and delta follows from its balance: the state is ln h.

    Returns
    -------
    dict
        ``lambda1``, ``lambda2``, the slope of the rate of ln h along delta(h), that of delta by ln h, and
        :data:`BY_FORCE`, in the rates and the slopes of a law.
    """
    generic = generic_dynamics(general=True)
    follows = -dF_dh / dF_ddelta  # d(delta)/dh at constant force
    zeta_along, remote_along = log_zeta_h + follows * log_zeta_delta, remote_h + follows * remote_delta
    by_deflection = remote_delta / zeta - dh_dt * log_zeta_delta
    forms = {
        lambda1: h * follows / delta,
        lambda2: -h * zeta_along - h * remote_along / (F - F_adh),
        SLOPES[0]: remote_along / zeta - dh_dt * zeta_along - dh_dt / h,
        SLOPES[2]: h * follows,
        BY_FORCE: (by_deflection / dF_ddelta - 1 / zeta) / h,
    }
    at_fixed_gap = generic.jacobians["h, delta"][0, 1]
    derived = {
        lambda1: generic.lambda1,
        lambda2: generic.lambda2,
        SLOPES[0]: generic.jacobians["ln h, delta from the force balance"][0, 0],
        SLOPES[2]: generic.lambda1 * delta,
        BY_FORCE: (at_fixed_gap / total(F_ela, delta) + diff(generic.dh_dt, F)) / h,
    }
    return _proved(forms, derived)


@cache
def by_centres() -> dict[Symbol, Expr]:
    """Rates and slopes where the centres are moved, through a spring: the state is (ln h, delta), and F is F_ela.

    The spring's base moves as dX_dt says: compliance dF/dt = dX/dt - dX_dt.
    """
    generic = generic_dynamics(general=True)
    softness = 2 + compliance * dF_ddelta

    def gap_by(variable: Symbol) -> Expr:
        zeta_slope, remote_slope, elastic_slope = _by_gap_and_deflection(variable)
        return (remote_slope - elastic_slope) / zeta - dh_dt * zeta_slope

    def deflection_by(variable: Symbol) -> Expr:
        bent = (dF_dh_h, dF_ddelta_h) if variable == h else (dF_dh_delta, dF_ddelta_delta)
        stiffer = dF_dh * gap_by(variable) + dh_dt * bent[0] + ddelta_dt * bent[1]
        return (gap_by(variable) - compliance * stiffer) / softness

    forms = {
        F: F_ela,
        ddelta_dt: (dh_dt - dX_dt - compliance * dF_dh * dh_dt) / softness,
        dF_dt: dF_ddelta * ddelta_dt + dF_dh * dh_dt,
        centres_rate: dh_dt - 2 * ddelta_dt,
        SLOPES[0]: gap_by(h) - dh_dt / h,
        SLOPES[1]: gap_by(delta) / h,
        SLOPES[2]: h * deflection_by(h),
        SLOPES[3]: deflection_by(delta),
    }

    # eq. 9 with C and D is dX/dt = dh/dt - 2 d(delta)/dt; with the spring's balance it gives the rate of the deflection
    force_rate = Symbol("force_rate", real=True)
    deflection_rate = generic.ddelta_dt.subs(dF_dt, force_rate)
    moving = _of_state(generic.X, dh_dt, ddelta_dt)
    (pulled,) = solve(Eq(deflection_rate, ddelta_dt), force_rate)
    (found,) = solve(Eq(compliance * pulled, moving - dX_dt), ddelta_dt)
    jacobian = generic.jacobians["h, delta"]
    driven = {x: jacobian[0, column] + diff(generic.dh_dt, F) * total(F_ela, x) for column, x in enumerate((h, delta))}

    def moved(expr: Expr, variable: Symbol) -> Expr:
        """Slope of what is made of the rates as well: dh/dt depends on the state, and so does d(delta)/dt."""
        return total(expr, variable) + diff(expr, dh_dt) * driven[variable]

    derived = {
        F: F_ela,
        ddelta_dt: found,
        dF_dt: pulled,
        centres_rate: moving,
        SLOPES[0]: driven[h] - dh_dt / h,
        SLOPES[1]: driven[delta] / h,
        SLOPES[2]: h * moved(found, h),
        SLOPES[3]: moved(found, delta),
    }
    return _proved(forms, derived, {ddelta_dt: found})


@cache
def by_gap() -> dict[Symbol, Expr]:
    """Rates and slopes of rigid particles, which have no deflection: the centres follow the gap."""
    generic = generic_dynamics(general=True)
    forms = {
        D: zeta,
        dh_dt: rates()[dh_dt],
        dX_dt: dh_dt,
        X: 2 * R + h,
        lambda2: -h * log_zeta_h - h * remote_h / (F - F_adh),
        SLOPES[0]: remote_h / zeta - dh_dt * log_zeta_h - dh_dt / h,
        SLOPES[2]: S.Zero,
        BY_FORCE: -1 / (zeta * h),
    }
    alone = generic.jacobians["ln h, delta"][0, 0]
    derived = {
        D: limit(generic.friction, C, oo),
        dh_dt: generic.dh_dt,
        dX_dt: _of_state(generic.X, dh_dt, S.Zero),
        X: generic.X.subs(delta, 0),
        lambda2: h * generic.jacobians["h, delta"][0, 0] / dh_dt,
        SLOPES[0]: alone,
        SLOPES[2]: S.Zero,
        BY_FORCE: diff(generic.dh_dt, F) / h,
    }
    return _proved(forms, derived)


@cache
def without_film() -> dict[Symbol, Expr]:
    """Rates and slopes of a dry contact, which has no gap of its own: it follows the force."""
    generic = generic_dynamics(general=True)
    still = {dh_dt: S.Zero}
    forms = {
        dh_dt: S.Zero,
        ddelta_dt: rates()[ddelta_dt].subs(still),
        dX_dt: -dF_dt / C,
        X: 2 * R - 2 * delta,
        SLOPES[0]: S.Zero,
        SLOPES[2]: S.Zero,
        BY_FORCE: S.Zero,
    }
    derived = {
        **dict.fromkeys(forms, S.Zero),
        ddelta_dt: generic.ddelta_dt.subs(still),
        dX_dt: _of_state(generic.X, S.Zero, generic.ddelta_dt.subs(still)),
        X: generic.X.subs(h, 0),
    }
    return _proved(forms, derived)
