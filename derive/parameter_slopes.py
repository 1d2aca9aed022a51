"""How a contact's rates and outputs depend on the parameters of its law: what its variational equations are made of.

Input: a law, the control, and the parameters of interest. Output: equations of a kernel besides those that it has
anyway. A trajectory y(t; p) with dy/dt = f(y, t, p) has the sensitivities s = dy/dp, for which

    ds/dt = (df/dy) s + df/dp

holds. df/dy is the Jacobian that the integration uses; here are df/dp, at fixed state, and what outputs add to it. The
chain rule is applied to the forms of :mod:`softdyn.derive.controls`; each result is asserted to be the derivative.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

from sympy import Expr, Function, S, Symbol, diff, expand, fraction, together

from softdyn.derive.controls import (
    BY_FORCE,
    SLOPES,
    X,
    by_centres,
    compliance,
    log_zeta_delta,
    rates,
    remote_delta,
    slopes_of,
)
from softdyn.derive.dynamics import (
    F_adh,
    F_ela,
    ddelta_dt,
    dF_ddelta,
    dF_dh,
    dh_dt,
    dX_dt,
    generic_dynamics,
    slope_of_radius,
    zeta,
)
from softdyn.derive.law import is_dry, is_rigid, parameters_of
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import F, a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

# slopes of a law by one of its parameters, at fixed h and delta: of a, F_ela, ln zeta, F_adh, and of F_ela's slopes
F_by, log_zeta_by, F_adh_by = Symbol("F_by", real=True), Symbol("log_zeta_by", real=True), Symbol("F_adh_by", real=True)
dF_dh_by, dF_ddelta_by = Symbol("dF_dh_by", real=True), Symbol("dF_ddelta_by", real=True)

#: Of the outputs that can be compared with what is measured, those of which the kernel gives the slopes.
MEASURED = {"force": ("X", "a"), "centres": ("X", "a", "F_ela")}


def state_outputs(by_force: bool) -> tuple[str, ...]:
    """Names of the slopes by the state and by what is given, in the order in which a kernel gives them.

    The Jacobian of the rates of the state, the slopes by the given force or velocity, and those of the outputs by h and
    by delta.
    """
    if by_force:
        jacobian = (SLOPES[0].name, SLOPES[2].name, BY_FORCE.name, "delta_by_force")
    else:
        jacobian = (*(symbol.name for symbol in SLOPES), "delta_rate_by_given")
    measured = MEASURED["force" if by_force else "centres"]
    return (*jacobian, *(f"{name}_by_{state}" for name in measured for state in ("h", "delta")))


def parameter_outputs(by_force: bool, parameter: str) -> tuple[str, ...]:
    """Names of the slopes by a parameter, in the order in which a kernel gives them.

    Those of the rate of ln h, of delta under a given force or else of its rate, and of the outputs.
    """
    measured = MEASURED["force" if by_force else "centres"]
    return tuple(f"{name}_by_{parameter}" for name in ("u_rate", "delta" if by_force else "delta_rate", *measured))


def sensitive_outputs(by_force: bool, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """All of these names."""
    slopes = (name for parameter in parameters for name in parameter_outputs(by_force, parameter))
    return (*state_outputs(by_force), *slopes)


def slopes_by(law: ContactLaw, control: str, parameters: tuple[str, ...]) -> dict[Symbol, Expr]:
    """Definitions of these outputs, in the symbols that a kernel defines.

    Parameters
    ----------
    law : ContactLaw
        With its parameters named as in the code.
    control : "force", "position", "velocity" or "spring"
    parameters : tuple of str
        Names of parameters of the law; that of a spring's compliance.
    """
    by_force = control == "force"
    rigid, dry = is_rigid(law), is_dry(law)
    place = S.Zero if rigid or dry else S.One
    distance = generic_dynamics(law.general).X.subs({delta: S.Zero} if rigid else {h: S.Zero} if dry else {})
    found: dict[str, Expr] = {
        f"{X.name}_by_h": diff(distance, h),
        f"{X.name}_by_delta": diff(distance, delta),
        "a_by_h": slope_of_radius(law, h),
        "a_by_delta": slope_of_radius(law, delta),
    }
    if by_force:
        found["delta_by_force"] = S.Zero if rigid else 1 / dF_ddelta
    else:
        found |= {"F_ela_by_h": dF_dh, "F_ela_by_delta": dF_ddelta}
        found["delta_rate_by_given"] = _moved()[ddelta_dt, dX_dt]
    for name in parameters:
        slopes = _slopes_of_law(law, name, mixed=control == "spring")
        found[f"X_by_{name}"] = diff(distance, _symbol(law, name))
        found[f"a_by_{name}"] = S.Zero if name == compliance.name else slope_of_radius(law, _symbol(law, name))
        if by_force:
            u_rate, follows = _by_force_balance()
            slopes |= slopes_of(law, (u_rate,))
            found[f"delta_by_{name}"] = S.Zero if rigid else follows.subs(slopes)
            if rigid:  # nothing follows of a deflection
                u_rate = u_rate.subs({log_zeta_delta: S.Zero, remote_delta: S.Zero})
            found[f"u_rate_by_{name}"] = S.Zero if dry else u_rate.subs(slopes)
            continue
        found[f"F_ela_by_{name}"] = slopes[F_by]
        gap_rate, deflection_rate = _moved()[dh_dt, F], _moved()[ddelta_dt, F]
        if name == compliance.name:
            gap_rate, deflection_rate = S.Zero, _moved()[ddelta_dt, compliance]
        found[f"u_rate_by_{name}"] = gap_rate.subs(slopes) / h * place
        found[f"delta_rate_by_{name}"] = deflection_rate.subs(slopes) * place
    return {Symbol(name, real=True): expr for name, expr in found.items()}


def _symbol(law: ContactLaw, name: str) -> Symbol:
    return next(symbol for symbol in (*parameters_of(law), compliance) if symbol.name == name)


def _slopes_of_law(law: ContactLaw, name: str, mixed: bool) -> dict[Symbol, Expr]:
    """Slopes by a parameter of what a law declares, sound in floating point; ``mixed`` ones by h and delta besides."""
    if name == compliance.name:
        return dict.fromkeys((F_by, log_zeta_by, F_adh_by, dF_dh_by, dF_ddelta_by), S.Zero)
    by = _symbol(law, name)
    radius = slope_of_radius(law, by)
    elastic = S.Zero if is_rigid(law) else law.F_ela

    def along(expr: Expr) -> Expr:
        """Slope of what is made of a, h, delta and the parameters."""
        return diff(expr, a) * radius + diff(expr, by)

    found = {
        F_by: sound(along(elastic)),
        log_zeta_by: S.Zero if is_dry(law) else sound(along(law.zeta) / law.zeta),
        F_adh_by: sound(along(law.F_adh)),
        dF_dh_by: S.Zero,
        dF_ddelta_by: S.Zero,
    }
    if mixed:
        for symbol, state in ((dF_dh_by, h), (dF_ddelta_by, delta)):
            turned = slope_of_radius(law, state)
            bent = slope_of_radius(law, state, by)
            slope = along(diff(elastic, a)) * turned + diff(elastic, a) * bent + along(diff(elastic, state))
            found[symbol] = sound(slope)
    return found


@cache
def _by_force_balance() -> tuple[Expr, Expr]:
    """Slopes of d(ln h)/dt and of delta by a parameter, at fixed h and force.

    Raises
    ------
    AssertionError
        If they are not the derivatives of eq. 7 and of the force balance.
    """
    follows = -F_by / dF_ddelta
    by_deflection = remote_delta / zeta - dh_dt * log_zeta_delta
    u_rate = (F_adh_by / zeta - dh_dt * log_zeta_by + by_deflection * follows) / h

    # eq. 7 and F_ela(h, delta; p) = F, with undefined functions of h, delta and a parameter
    p = Symbol("p", real=True)
    place = Function("delta")(p)
    elastic, friction, remote = (Function(name)(delta, p) for name in ("F_ela", "zeta", "F_adh"))
    balance = elastic.subs(delta, place).diff(p)
    (moved,) = _solved(balance, place.diff(p))
    rate = rates()[dh_dt].subs({F_adh: remote, zeta: friction})
    derived = (diff(rate, p) + diff(rate, delta) * moved.subs(place, delta)) / h
    _require_equal(u_rate, derived, _named(elastic, friction, remote, p))
    _require_equal(follows, moved.subs(place, delta), _named(elastic, friction, remote, p))
    return u_rate, follows


@cache
def _moved() -> dict[tuple[Symbol, Symbol], Expr]:
    """Slopes of dh/dt and d(delta)/dt where the centres are moved, at fixed state: by a parameter, and by what moves.

    Under (rate, F) that by a parameter of the law, under (ddelta_dt, dX_dt) that by the given velocity, under
    (ddelta_dt, compliance) that by the compliance of a spring.

    Raises
    ------
    AssertionError
        If they are not the derivatives.
    """
    softness = 2 + compliance * dF_ddelta
    gap = (F_adh_by - F_by) / zeta - dh_dt * log_zeta_by
    stiffer = dF_dh * gap + dh_dt * dF_dh_by + ddelta_dt * dF_ddelta_by
    forms = {
        (dh_dt, F): gap,
        (ddelta_dt, F): (gap - compliance * stiffer) / softness,
        (ddelta_dt, dX_dt): -1 / softness,
        (ddelta_dt, compliance): -(dF_dh * dh_dt + dF_ddelta * ddelta_dt) / softness,
    }
    p = Symbol("p", real=True)
    elastic, friction, remote = (Function(name)(delta, p) for name in ("F_ela", "zeta", "F_adh"))
    by_gap, by_deflection = (Function(name)(p) for name in ("dF_dh", "dF_ddelta"))
    rate = rates()[dh_dt].subs(F, F_ela).subs({F_ela: elastic, F_adh: remote, zeta: friction})
    deflection = by_centres()[ddelta_dt].subs({dh_dt: rate, dF_dh: by_gap, dF_ddelta: by_deflection})
    names = _named(elastic, friction, remote, p) | {
        by_gap.diff(p): dF_dh_by,
        by_deflection.diff(p): dF_ddelta_by,
        by_gap: dF_dh,
        by_deflection: dF_ddelta,
    }
    derived = {
        (dh_dt, F): diff(rate, p),
        (ddelta_dt, F): diff(deflection, p),
        (ddelta_dt, dX_dt): diff(deflection, dX_dt),
        (ddelta_dt, compliance): diff(deflection, compliance),
    }
    rate_of = {ddelta_dt: by_centres()[ddelta_dt]}
    for key, form in forms.items():
        _require_equal(form.subs(rate_of).subs(dh_dt, rates()[dh_dt].subs(F, F_ela)), derived[key], names)
    return forms


def _named(elastic: Expr, friction: Expr, remote: Expr, p: Symbol) -> dict[Expr, Expr]:
    """Undefined functions and their derivatives, and the symbols that stand for them."""
    return {
        elastic.diff(p): F_by,
        friction.diff(p): zeta * log_zeta_by,
        remote.diff(p): F_adh_by,
        elastic.diff(delta): dF_ddelta,
        friction.diff(delta): zeta * log_zeta_delta,
        remote.diff(delta): remote_delta,
        elastic: F_ela,
        friction: zeta,
        remote: F_adh,
    }


def _solved(balance: Expr, unknown: Expr) -> list[Expr]:
    """What an unknown is, of which a balance is linear."""
    balance = expand(balance.doit())
    return [-(balance - balance.coeff(unknown) * unknown) / balance.coeff(unknown)]


def _require_equal(form: Expr, derived: Expr, names: Mapping[Expr, Expr]) -> None:
    difference = (form - derived.doit().subs(names)).subs(names)
    difference = difference.subs(dh_dt, rates()[dh_dt])
    assert expand(fraction(together(difference))[0]) == 0, f"this is not what is derived: {form}"
