"""The dynamics of a law, for whoever reads it: rates, stiffness, friction, exponents and Jacobians.

Input: a law, and the rates derived for any law (:mod:`softdyn.derive.controls`). Output: the same in a, h, delta, F,
dF_dt and the law's parameters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sympy import Add, Expr, Matrix, S, Symbol, factor_terms

from softdyn.derive import controls
from softdyn.derive.controls import lambda1, lambda2, log_zeta_h, remote_h
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
    lambda1_of,
    partials,
    total,
    zeta,
)
from softdyn.derive.equations import with_known
from softdyn.derive.law import is_dry, is_rigid
from softdyn.derive.soundness import sound, tidy
from softdyn.derive.symbols import h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw


def law_quantities(law: ContactLaw) -> dict[str, Expr]:
    """The dynamics of a law, in a, h, delta, F, dF_dt and the parameters.

    Returns
    -------
    dict
        ``a`` (in h and delta), ``F_ela``, ``zeta``, ``F_adh``, ``C`` (stiffness), ``D`` (friction), ``dh_dt`` (eq. 7),
        ``ddelta_dt``, ``dX_dt`` (eq. 9), ``lambda1`` and ``lambda2``.
    """
    values, generic = partials(law), generic_dynamics(law.general)
    if is_rigid(law):
        return _rigid_quantities(law, values)
    known: dict[Symbol, Expr] = {C: sound(with_known(generic.stiffness, values))}
    known[dF_ddelta] = 2 * known[C]
    elastic = {"a": sound(law.a), F_ela.name: values[F_ela]}
    if is_dry(law):
        rates = controls.without_film()
        given = {symbol.name: rates[symbol].subs(known) for symbol in (ddelta_dt, dX_dt)}
        beside = {F_adh.name: values[F_adh], "dashpot": sound(law.dashpot)}
        return {**elastic, **{name: expr for name, expr in beside.items() if expr != 0}, C.name: known[C], **given}
    rates = controls.rates()
    known[dF_dh] = with_known(generic.by_gap, values)
    known[D] = sound(with_known(generic.friction.subs(C, known[C]), values))
    known[dh_dt] = sound(with_known(generic.dh_dt, values))
    forced = rates[dX_dt].coeff(dF_dt) * dF_dt
    steady = rates[dX_dt].subs(dF_dt, S.Zero)
    return {
        **elastic,
        zeta.name: values[zeta],
        F_adh.name: values[F_adh],
        C.name: known[C],
        D.name: known[D],
        dh_dt.name: known[dh_dt],
        ddelta_dt.name: sound(with_known(rates[ddelta_dt], known)),
        dX_dt.name: with_known(forced, known) - sound(with_known(with_known(-steady, known), values)),
        lambda1.name: sound(lambda1_of(law, known[dF_ddelta])),
        lambda2.name: sound(with_known(generic.lambda2.subs(dh_dt, known[dh_dt]).subs(C, known[C]), values)),
    }


def _rigid_quantities(law: ContactLaw, values: dict[Symbol, Expr]) -> dict[str, Expr]:
    """No deflection: the centres follow the gap, D = zeta."""
    rates = controls.by_gap()
    gap_rate = sound(with_known(generic_dynamics(law.general).dh_dt, values))
    slopes = {log_zeta_h: total(zeta, h) / zeta, remote_h: total(F_adh, h)}
    slopes = {symbol: slope.subs({s: x for s, x in values.items() if s != zeta}) for symbol, slope in slopes.items()}
    parts = (with_known(with_known(term, slopes), values) for term in Add.make_args(rates[lambda2]))
    return {
        "a": sound(law.a),
        zeta.name: values[zeta],
        F_adh.name: values[F_adh],
        D.name: with_known(rates[D], values),
        dh_dt.name: gap_rate,
        dX_dt.name: rates[dX_dt].subs(dh_dt, gap_rate),
        lambda2.name: Add(*(h * sound(part / h) for part in parts)),
    }


def law_jacobians(law: ContactLaw) -> dict[str, Matrix]:
    """Jacobians of the rates of the state, by state formulation, in a, h, delta, dh_dt, ddelta_dt, C and zeta."""
    if is_rigid(law) or is_dry(law):
        return {}  # one state variable, or none
    values = {symbol: expr for symbol, expr in partials(law).items() if symbol != zeta}
    return {
        state: jacobian.applyfunc(lambda entry: factor_terms(tidy(entry.subs(values))))
        for state, jacobian in generic_dynamics(law.general).jacobians.items()
    }
