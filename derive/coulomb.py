"""Coulomb friction as a return map, with its consistent tangent.

Surfaces that touch are joined by a tangential spring (Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47): its force
T follows their slip s, the displacement of one along the other in the contact's rotating frame, with the stiffness k_t.
Coulomb's law lets them slide by gamma along T, so that |T| <= mu N::

    T = T_trial - k_t gamma T/|T| ,   gamma >= 0 ,   |T| <= mu N ,   gamma (|T| - mu N) = 0 ,   T_trial = T_0 + k_t s

Where |T_trial| <= mu N nothing slides. Elsewhere the two are parallel, |T| = mu N, and ::

    T = keep T_trial ,   keep = mu N/|T_trial| ,   gamma = (|T_trial| - mu N)/k_t

What slides dissipates |T| gamma. Rolling and twisting are resisted by springs of the same kind, whose forces have the
levers R: their largest moments are fractions of R N.

**Rubbing.** Between surfaces with a film, N is the load that they bear themselves, as they touch at a roughness, and
the spring stands beside the film: both slide, roll and turn with the same bodies. Load and stiffness are functions of
the contact, mu may be one of h and of the speed of sliding. In an implicit stage, T_0 is what is known of the force, s
= gamma dt times its rate what is not, and the map is applied at its end: |T| <= mu N holds wherever a step ends.

The tangent has three parts: across T the trial force passes as much as is kept of it; along T, where surfaces slide,
none of it does, but T changes with its bound::

    dT = keep (1 - T T/|T|^2) dT_trial + T/|T| (d bound/d N dN + d bound/d h dh + d bound/d slip_rate d slip_rate)

**Energy.** The slip puts in T ds/dt = |T| dgamma/dt + d(T^2/(2 k_t))/dt + T^2 (dk_t/dt)/(2 k_t^2): lost, stored, and
taken by a change of the stiffness, as of the film's (see :mod:`softdyn.derive.tangential`).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from sympy import Expr, Function, Piecewise, Symbol, diff, exp, simplify, sqrt

from softdyn.derive.dynamics import a_delta, a_h
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import a, delta, h, slip_rate

if TYPE_CHECKING:
    from softdyn.derive.law import Rubbing

#: Size of the trial force, and the largest force; what is kept of the trial force.
size, most = Symbol("size", nonnegative=True), Symbol("most", nonnegative=True)
keep = Symbol("keep", nonnegative=True)
mu, N = Symbol("mu", nonnegative=True), Symbol("N", nonnegative=True)


@cache
def return_map() -> Expr:
    """Factor ``keep`` of the trial force, a function of its ``size`` and of the ``most`` that friction bears.

    Raises
    ------
    AssertionError
        If it is not the solution of Coulomb's law.
    """
    k_t, gamma = Symbol("k_t", positive=True), Symbol("gamma", nonnegative=True)
    trial, bound = Symbol("trial", positive=True), Symbol("bound", nonnegative=True)
    sliding = bound / trial
    # along T_trial, of the length trial: T = trial - k_t gamma, at the bound
    slid = (trial - bound) / k_t
    assert simplify(sliding * trial - (trial - k_t * gamma).subs(gamma, slid)) == 0, "the return map is wrong"
    return Piecewise((most / size, size > most), (1, True))


@cache
def tangent() -> dict[str, Expr]:
    """Consistent tangent of the return map, where it slides.

    Returns
    -------
    dict
        ``along`` and ``across``: dT/dT_trial along T_trial, and across it, in units of 1; ``by_N``: d|T|/dN.

    Raises
    ------
    AssertionError
        If these are not the derivatives.
    """
    x, y = Symbol("x", positive=True), Symbol("y", real=True)
    length = sqrt(x**2 + y**2)
    force = [mu * N * x / length, mu * N * y / length]
    found = {"along": x * 0, "across": mu * N / size, "by_N": mu}
    assert simplify(force[0].diff(x).subs(y, 0) - found["along"]) == 0, "the tangent along the slip is wrong"
    assert simplify(force[1].diff(y).subs(y, 0) - found["across"].subs(size, x)) == 0, "that across it is wrong"
    assert simplify(force[0].diff(N).subs(y, 0) - found["by_N"]) == 0, "that by the normal force is wrong"
    return found


#: Of the contact's stage: the weight of what fades, with its slope, and dh/dr along the contact's equation.
w, w_h, h_r = Symbol("w", nonnegative=True), Symbol("w_h", real=True), Symbol("h_r", real=True)
#: The load that surfaces bear as they touch, as declared and with its weight; the stiffness of the spring.
bare, load, k_rub = Symbol("bare_load", real=True), Symbol("load", nonnegative=True), Symbol("k_rub", nonnegative=True)
load_r, k_rub_r = Symbol("load_r", real=True), Symbol("k_rub_r", real=True)
_OF_H = {symbol: Symbol(f"{symbol.name}_h", real=True) for symbol in (bare, k_rub)}
_OF_DELTA = {symbol: Symbol(f"{symbol.name}_delta", real=True) for symbol in (bare, k_rub)}
#: What the kernel gives of surfaces that rub; what ``state`` reports of them.
OUTPUTS = (load, load_r, k_rub, k_rub_r, h_r)
STATE_OUTPUTS = (load, k_rub, _OF_H[k_rub], _OF_DELTA[k_rub])
#: What is kept of the trial force, and the slopes of its bound in the load, the gap and the speed.
by_load, by_h, by_rate = Symbol("by_load", nonnegative=True), Symbol("by_h", real=True), Symbol("by_rate", real=True)
MAP = (keep, by_load, by_h, by_rate)


@cache
def along_r() -> dict[Symbol, Expr]:
    """Slopes of load and stiffness in the distance r of the centres, for any law.

    Raises
    ------
    AssertionError
        If they are not the derivatives along the contact's equation.
    """
    slopes: dict[Symbol, Expr] = {
        load_r: w * (_OF_H[bare] * h_r + _OF_DELTA[bare] * (h_r - 1) / 2) + w_h * h_r * bare,
        k_rub_r: _OF_H[k_rub] * h_r + _OF_DELTA[k_rub] * (h_r - 1) / 2,
    }
    # delta = (S - r + h(r))/2; exponentials stand for any function, which is a sum of such
    r, whole, p, q, m = (Symbol(name, positive=True) for name in ("r", "S", "p", "q", "m"))
    gap = Function("gap")(r)
    form, weight = exp(p * gap + q * (whole - r + gap) / 2), exp(m * gap)
    values = {h_r: diff(gap, r), w: weight, w_h: m * weight, bare: form}
    for symbol, slope, weighted in ((bare, load_r, weight * form), (k_rub, k_rub_r, form)):
        values |= {_OF_H[symbol]: p * form, _OF_DELTA[symbol]: q * form}
        difference = simplify(diff(weighted, r) - slopes[slope].xreplace(values))
        assert difference == 0, f"the slope of {symbol} is wrong: {difference}"
    return slopes


def rubbing_definitions(rubbing: Rubbing) -> dict[Symbol, Expr]:
    """What a law declares of surfaces that rub, with slopes, each in terms of earlier ones."""
    declared = {bare: rubbing.load, k_rub: rubbing.k_t}
    by_gap = {_OF_H[x]: sound(diff(expr, h) + diff(expr, a) * a_h) for x, expr in declared.items()}
    by_deflection = {_OF_DELTA[x]: sound(diff(expr, delta) + diff(expr, a) * a_delta) for x, expr in declared.items()}
    return {**{x: sound(expr) for x, expr in declared.items()}, **by_gap, **by_deflection, load: w * bare, **along_r()}


def bounded_force(relative: Expr) -> dict[Symbol, Expr]:
    """Return map of a contact, and what its tangent needs: see the module.

    Parameters
    ----------
    relative : Expr
        Coefficient of friction over mu, a function of h and slip_rate.
    """
    slopes = tangent()
    assert slopes["by_N"] == mu, "|T| = mu N where surfaces slide"
    assert slopes["along"] == 0, "along the slip the trial force does not pass"
    assert (slopes["across"].subs(mu * N, most) - return_map().args[0][0]) == 0, "across it passes as much as is kept"
    bound = mu * relative * load
    return {
        most: bound,
        keep: return_map(),
        by_load: diff(bound, load),
        by_h: sound(diff(bound, h)),
        by_rate: sound(diff(bound, slip_rate)),
    }


__all__ = [
    "MAP", "OUTPUTS", "STATE_OUTPUTS", "along_r", "bounded_force", "keep", "return_map", "rubbing_definitions",
    "tangent",
]  # fmt: skip
