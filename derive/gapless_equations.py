"""The equations of many contacts without a gap state: dry ones, and those of rigid particles.

Input: a law and what a scene needs of it. Output: the equations of its contacts, from which their kernel is made.

Of the overlap S - r of two particles, the sum of their radii less the distance of their centres, all follows: a dry
contact (zeta = 0) has surfaces that touch, h = 0, where it is positive, and a gap without any deflection where it is
not; rigid particles (F_ela = oo) have a gap alone, which is never closed::

    dry:    delta = max(overlap, 0)/2 ,  h = max(-overlap, 0) ,  F = F_ela - dashpot dr/dt + w F_adh
    rigid:  delta = 0 ,  h = -overlap > 0 ,                      F = -w zeta dr/dt + w F_adh

The elastic force and the dashpot are there where surfaces touch alone; w(h) is the weight of a contact that has a
range, as in :mod:`softdyn.derive.contact_equations`. Where the fluid resists the particles by themselves, zeta of rigid
particles is what it exceeds these drags by, as there.

At an implicit stage, x = x* + s v, the rate dr/dt = n . (v_j - v_i + u) of the distance, u the velocity of an image or
of a wall, follows from the positions, too: d(dr/dt)/dr = 1/s along n. With it the consistent tangent of a contact is

    dF/dr = -F_;delta/2 - friction/s - (d friction/dr) dr/dt + d(w F_adh)/dr .

The rate also changes as n turns, by P (v_j - v_i + u)/r with P = 1 - n n^T: smaller than 1/s by the part of the
distance that the particles move in the stage, and left out of the matrix of Newton's iteration, not of the forces.
No time passes where 1/s = 0: then what resists a rate does nothing.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from sympy import Dummy, Expr, Integer, Max, Min, Piecewise, S, Symbol, diff, expand, powsimp, simplify

from softdyn.derive import coulomb
from softdyn.derive import dynamics as d
from softdyn.derive import tangential as tangential_stage
from softdyn.derive.contact_equations import (
    FADING,
    WEIGHT,
    F,
    F_by_distance,
    F_by_gap,
    F_r,
    ahead,
    carried_friction,
    dh_dt,
    fading,
    friction,
    h_r,
    is_unequal,
    overlap,
    remote,
    s,
    started,
    tangential_outputs,
    w,
    w_h,
)
from softdyn.derive.controls import log_zeta_delta, log_zeta_h, remote_h
from softdyn.derive.dynamics import C, F_adh, F_ela, dF_ddelta, dF_dh, partials, total, zeta
from softdyn.derive.equations import Equations
from softdyn.derive.law import Rubbing, in_code, is_rigid
from softdyn.derive.soundness import relative_slope, sound
from softdyn.derive.symbols import a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.law import ContactLaw

#: The rate dr/dt of the distance, and 1/s, which is 0 where no time passes.
rate, pace = Symbol("rate", real=True), Symbol("pace", nonnegative=True)
#: 1 where surfaces touch, 0 elsewhere.
touch = Symbol("touch", nonnegative=True)
#: The friction coefficient of the contact and its slope in r; the remote force with its weight, and its slope in r.
friction_r, remote_r = Symbol("friction_r", real=True), Symbol("remote_r", real=True)
#: The dashpot of a dry contact, and its slope in delta.
dashpot, dashpot_delta = Symbol("dashpot", nonnegative=True), Symbol("dashpot_delta", real=True)
#: What the force is without the friction.
static = Symbol("static", real=True)


@cache
def force_of_contact() -> dict[Symbol, Expr]:
    """Derive the force of one contact and its consistent tangent, for any law.

    Returns
    -------
    dict
        ``h_r`` = dh/dr, ``F``, ``F_r`` = dF/dr in a stage, and the slopes in r of all that F is made of.

    Raises
    ------
    AssertionError
        If the forms that the kernel computes are not the derivatives.
    """
    # h + 2 delta is |overlap|: one of them follows r at a time
    gap_by_r = 1 - touch
    deflection_by_r = -touch / 2
    force = touch * F_ela - friction * rate + remote
    slope = -touch * dF_ddelta / 2 - friction * pace - friction_r * rate + remote_r
    of_dry, of_rigid = touch * dashpot, w * zeta

    def along(expr: Expr) -> Expr:
        """Derivative by r, the distance's rate apart."""
        through_gap = total(expr, h) + diff(expr, w) * w_h
        through_deflection = total(expr, delta) + diff(expr, dashpot) * dashpot_delta
        return through_gap * gap_by_r + through_deflection * deflection_by_r

    # each side of the touch: F_ela has a slope there alone, the remote force elsewhere alone
    forms = {
        "dry": {friction: of_dry, friction_r: -touch * dashpot_delta / 2},
        "rigid": {friction: of_rigid, friction_r: w_h * zeta + w * zeta * log_zeta_h},
    }
    attraction = {remote: w * F_adh, remote_r: (1 - touch) * (w_h * F_adh + w * remote_h)}
    stiffness = {dF_ddelta: total(F_ela, delta)}
    for kind, of_friction in forms.items():
        for side in (1, 0) if kind == "dry" else (0,):
            at = {touch: side, **({w: 1, w_h: 0} if side else {})}
            # what of zeta goes with a gap alone: of rigid particles nothing is deflected
            known = {log_zeta_h: total(zeta, h) / zeta, remote_h: total(F_adh, h)}
            whole = force.subs({**of_friction, **attraction})
            derived = along(whole).subs(at) + diff(whole, rate).subs(at) * pace
            claimed = slope.subs({**of_friction, **attraction}).subs({**stiffness, **known}).subs(at)
            no_remote_in_touch = {d.F_adh_a: 0, d.F_adh_delta: 0} if side else {}
            difference = expand(simplify((derived - claimed).subs(no_remote_in_touch)))
            assert difference == 0, f"the consistent tangent of a {kind} contact is wrong: {difference}"
    return {h_r: gap_by_r, F: force, F_r: slope}


def _of_law(law: ContactLaw, needs: ContactNeeds) -> dict[Symbol, Expr]:
    """Friction, and what it is made of, of a law's contacts."""
    values = partials(law)
    if is_rigid(law):
        slopes = {**values, d.zeta_a: relative_slope(values[zeta], a), d.zeta_h: relative_slope(values[zeta], h)}
        relative = sound(total(zeta, h).subs(slopes))
        beside, carried, slope = carried_friction(law, needs.drag, is_unequal(law, needs))
        return {
            **beside,
            zeta: carried * values[zeta],
            log_zeta_h: relative + slope,
            log_zeta_delta: S.Zero,
            friction: w * zeta,
            friction_r: w_h * zeta + w * zeta * log_zeta_h,
        }
    along_delta = diff(law.dashpot, delta) + diff(law.dashpot, a) * d.a_delta
    return {
        dashpot: sound(law.dashpot),
        dashpot_delta: _in_touch(sound(along_delta.subs(values))),
        friction: touch * dashpot,
        friction_r: -touch * dashpot_delta / 2,
    }


def _in_touch(slope: Expr) -> Expr:
    """A slope that may have no bound where surfaces just touch: elsewhere, without touch, none."""
    return slope if slope.is_number else Piecewise((slope, overlap > 0), (S.Zero, True))


def _stiffness(law: ContactLaw) -> Expr:
    """dF_ela/d(delta) of a dry law, in the form that is finite where surfaces just touch, if there is one."""
    size = Dummy("delta", positive=True)
    direct = powsimp(simplify(diff(law.F_ela.subs(a, law.a).subs(delta, size), size)))
    at_touch = direct.subs(size, 0)
    return direct.subs(size, delta) if at_touch.is_finite else sound(2 * d.stiffness_of(law))


def _rubbing(law: ContactLaw) -> dict[Symbol, Expr]:
    """What is declared of surfaces that rub; of dry ones all that presses them, but for remote forces.

    Surfaces that part fast are pulled by the dashpot, and then rub no more.
    """
    if law.rubbing is not None:
        return coulomb.rubbing_definitions(law.rubbing)
    assert law.tangential is not None, "a law without a stiffness is refused before"
    found = coulomb.rubbing_definitions(Rubbing(load=S.Zero, k_t=law.tangential.k_t))
    pressing = F_ela * touch - friction * rate
    slope = -touch * dF_ddelta / 2 - friction * pace - friction_r * rate
    assert expand(force_of_contact()[F] - pressing - remote) == 0, "the load is not what the contact presses with"
    assert expand(force_of_contact()[F_r] - slope - remote_r) == 0, "its slope is not that of the force"
    found |= {coulomb.load: Max(0, pressing), coulomb.load_r: Piecewise((slope, coulomb.load > 0), (S.Zero, True))}
    return {symbol: _in_touch(expr) if symbol in coulomb.STATE_OUTPUTS[1:] else expr for symbol, expr in found.items()}


def gapless_equations(law: ContactLaw, needs: ContactNeeds) -> Equations:
    """Everything there is to say about a contact without a gap state, before any specialisation.

    Each quantity is in terms of overlap, rate, s, pace, the parameters and earlier ones.
    """
    # the names of a law's own parameters may be those of the kernel's variables
    law = in_code(law)
    values, rigid = partials(law), is_rigid(law)
    sliding: dict[Symbol, Expr] = {}
    if needs.tangential or needs.rubbing:
        sliding = {symbol: values[symbol] for symbol in (d.a_h, d.a_delta)}
    if needs.tangential and law.tangential is not None:
        sliding |= tangential_stage.tangential_definitions(law.tangential)
    if needs.rubbing:
        sliding |= _rubbing(law)
    if sliding and not rigid:  # what slides is what touches
        sliding = {x: expr.subs({w: touch, w_h: 0}) for x, expr in sliding.items()}
    definitions = {
        touch: S.Zero if rigid else Piecewise((Integer(1), overlap > 0), (Integer(0), True)),
        delta: S.Zero if rigid else Max(0, overlap) / 2,
        h: -overlap if rigid else Max(0, -overlap),
        a: sound(law.a),
        F_ela: S.Zero if rigid else values[F_ela],
        F_adh: values[F_adh],
        dF_ddelta: S.Zero if rigid else _in_touch(_stiffness(law)),
        C: dF_ddelta / 2,
        dF_dh: S.Zero,
        remote_h: sound(total(F_adh, h).subs(values)),
        fading: FADING,
        started: Min(1, fading),
        ahead: Max(0, started),
        w: WEIGHT,
        w_h: diff(WEIGHT, ahead) * diff(FADING, h),
        remote: w * F_adh,
        remote_r: (1 - touch) * (w_h * F_adh + w * remote_h),
        **_of_law(law, needs),
        **force_of_contact(),
        dh_dt: (1 - touch) * rate,
        F_by_gap: S.Zero,
        # at a given rate
        F_by_distance: -touch * dF_ddelta / 2 - friction_r * rate + remote_r,
        **sliding,
    }
    return Equations(definitions, frozenset({F, F_r, *tangential_outputs(needs)}))


__all__ = ["force_of_contact", "gapless_equations", "pace", "rate", "s", "touch"]
