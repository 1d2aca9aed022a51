"""The equations of many contacts: one implicit stage of every gap, at given distances of the centres.

Input: a law and what a scene needs of it. Output: the equations of its contacts, from which their kernel is made.

Each contact has one state, its gap h. Its deflection follows from the distance r of the centres and the sum S of the
radii (eq. 2 of Rognon & Gay with delta on both sides)::

    delta = (overlap + h)/2 ,     overlap = S - r

Unequal spheres: to second order the surfaces are h + rho^2 (1/R1 + 1/R2)/2 apart at the distance rho from the axis,
which is h + rho^2/R with R = 2 R1 R2/(R1 + R2), the profile of two equal spheres of radius R. The film has the same
pressure then, each surface is a half-space under that pressure, and gives in as 1/E_i whatever its own radius. The sum
of both deflections, which is all that the geometry needs, is 2 delta with 1/E = (1/E1 + 1/E2)/2. A wall is R2 -> oo:
R = 2 R1, S = R1, r the distance of the centre from the wall; a rigid one, E2 -> oo, makes E = 2 E1.

One stage of a diagonally implicit Runge-Kutta method asks for y = y* + s dy/dt, s = gamma dt, with a state y(h) of our
choice. It must keep h > 0 at any step, as ln h does, and cost no exponential. With g the gap at the start of the step,

    y = (h/g - g/h)/2 = sinh(ln(h/g)) ,     h/g = y + sqrt(1 + y^2)

maps h > 0 onto all real y, agrees with ln(h/g) to second order, and is algebraic: compilers vectorise it. The scalar
equation of a contact, with eq. 7, is H = 0,

    H = f (y - y*) + s y_h (F_ela - f F_adh)/zeta ,     F = g F_ela ,

where f (film) and g (grip) are the weights of the film and of the elastic force in a contact that has a range. From
half of it on, w(h) falls from 1 to 0. Where the surfaces are pressed together, f = w and g = 1: film and remote force
fade, and gap and centres go together in the end. Where they are pulled apart, f = 1 and g = w: what they pull with
fades, and the gap opens as if there were no range. So F = 0 at the range in either case: a contact is made and dropped
without a jump in force; and both agree at delta = 0. H rises with h: its sign there tells which of them holds. (With
f = w everywhere a pulled contact snaps off, since -F/(w zeta) has no bound; with f = 1 a pair that comes fast is
pressed deep before it feels a force.) A contact stores g U, dissipates w zeta (dh/dt)^2, takes w F_adh from remote
forces, and adds g_h U to the slope in h of what it stores.

The zeta of a law is that of two equal particles of radius R. What else differs with the ratio of the radii is a factor
that it may declare (``unequal``), 1 to leading order near contact. Where the fluid resists the particles by themselves,
zeta is that times what it exceeds these drags by, a function of h: see :mod:`softdyn.derive.far_field`.

Newton's iteration solves H, and the implicit function theorem gives the consistent tangent dF/dr along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from sympy import Add, Expr, Function, Max, Min, Mul, Piecewise, S, Symbol, diff, expand, simplify

from softdyn.derive import controls, coulomb, far_field
from softdyn.derive import dynamics as d
from softdyn.derive import tangential as tangential_stage
from softdyn.derive.controls import log_zeta_delta, log_zeta_h, remote_delta, remote_h
from softdyn.derive.dynamics import C, F_adh, F_ela, dF_ddelta, dF_dh, partials, total, zeta
from softdyn.derive.equations import Equations
from softdyn.derive.law import in_code
from softdyn.derive.soundness import relative_slope, sound, tidy
from softdyn.derive.symbols import F as FORCE
from softdyn.derive.symbols import R, a, delta, h, size_ratio

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

# the contact's data: sum of the radii less the distance of the centres, gap at the start of the step, its range
overlap = Symbol("overlap", real=True)
g, reach = Symbol("g", positive=True), Symbol("reach", positive=True)
# the stage's data, and the state y(h)
s, y_star = Symbol("s", positive=True), Symbol("y_star", real=True)
Y, Y_h, Y_hh = Symbol("Y", real=True), Symbol("Y_h", positive=True), Symbol("Y_hh", real=True)
# the weight of a contact, with the fraction of the fading zone that is still ahead
w, w_h, ahead = Symbol("w", nonnegative=True), Symbol("w_h", real=True), Symbol("ahead", nonnegative=True)
# the same fraction before it is cut at 1 and at 0, one cut at a time
fading, started = Symbol("fading", real=True), Symbol("started", real=True)
# the weights of the film and of the elastic force, and their slopes
film, film_h = Symbol("film", nonnegative=True), Symbol("film_h", real=True)
grip, grip_h = Symbol("grip", nonnegative=True), Symbol("grip_h", real=True)
# whether surfaces are pressed together, and H of pulled ones at delta = 0, which tells it
pressed, side = Symbol("pressed", nonnegative=True), Symbol("side", real=True)
# the approach rate -film dh/dt, and the derivatives along the contact's equation
rho, rho_h, rho_r = (Symbol(name, real=True) for name in ("rho", "rho_h", "rho_r"))
H, H_h, H_r, h_r = (Symbol(name, real=True) for name in ("H", "H_h", "H_r", "h_r"))
# the force that reaches the particles, its consistent tangent, and its slopes at fixed distance and at fixed gap
F, F_r = Symbol("F", real=True), Symbol("F_r", real=True)
F_by_gap, F_by_distance = Symbol("F_by_gap", real=True), Symbol("F_by_distance", real=True)
# by how much the friction exceeds the drags of the particles by themselves, relative to these, and its slope
excess, excess_h = Symbol("excess", positive=True), Symbol("excess_h", real=True)
# friction of particles of different radii over that of equal ones, and its relative slope
of_radii, of_radii_h = Symbol("of_radii", positive=True), Symbol("of_radii_h", real=True)
#: The part of these drags that a scene leaves out: 0 where there is all of them. No parameter of a law has such a name.
undragged = Symbol("undragged_p1", nonnegative=True)
friction, remote, dh_dt = Symbol("friction", real=True), Symbol("remote", real=True), Symbol("dh_dt", real=True)

#: y, and the weight: 1 up to half the range, 0 beyond it, with a continuous slope.
STATE = (h / g - g / h) / 2
FADING = 2 * (reach - h) / reach
WEIGHT = ahead**2 * (3 - 2 * ahead)


@dataclass(frozen=True)
class ContactNeeds:
    """What a scene needs of the kernel of its contacts.

    Parameters
    ----------
    varying : tuple of str
        Parameters that differ from contact to contact; the others are uniform. Where radii differ "size_ratio" is among
        them; a kernel takes it if the law has a use for it.
    fading : bool
        Whether contacts have a range.
    tangential : bool
        Whether particles slide and roll on one another.
    drag : bool
        Whether the fluid resists the particles by themselves.
    rubbing : bool
        Whether surfaces rub, as far as Coulomb friction lets them.
    explicit : bool
        Whether steps are explicit in the positions: then slopes along the distance are of no use, and what bounds such
        a step, and what contacts dissipate, is.
    """

    varying: tuple[str, ...] = ()
    fading: bool = False
    tangential: bool = False
    drag: bool = False
    explicit: bool = False
    rubbing: bool = False


@cache
def stage_equation() -> dict[Symbol, Expr]:
    """Derive the equation of one contact and its consistent tangent, for any law.

    Returns
    -------
    dict
        ``rho`` = (F_ela - film F_adh)/zeta, ``H``, its derivatives ``H_h`` at fixed r and ``H_r`` at fixed h, ``h_r`` =
        dh/dr along H = 0, the weighted force ``F``, ``F_r`` = dF/dr along H = 0, and the slopes of F apart from it.

    Raises
    ------
    AssertionError
        If the forms that the kernel computes are not the derivatives.
    """
    # eq. 7, of the balance of the film with its weight
    rate = -controls.rates()[d.dh_dt].subs({FORCE: F_ela, F_adh: film * F_adh})
    residual = film * (Y - y_star) + s * Y_h * rho
    weighted = grip * F_ela

    def along_h(expr: Expr) -> Expr:
        """Derivative by h at fixed r: delta = (overlap + h)/2 takes half of it."""
        moving = diff(expr, Y) * Y_h + diff(expr, Y_h) * Y_hh + diff(expr, film) * film_h + diff(expr, grip) * grip_h
        return total(expr, h) + total(expr, delta) / 2 + moving

    def along_r(expr: Expr) -> Expr:
        """Derivative by r at fixed h."""
        return -total(expr, delta) / 2

    slopes = controls.slopes_of_any_law()
    # written with relative slopes of zeta, which neither overflow nor cancel where zeta does
    rate_h = (dF_dh + dF_ddelta / 2 - film_h * F_adh - film * (remote_h + remote_delta / 2)) / zeta - rho * (
        log_zeta_h + log_zeta_delta / 2
    )
    rate_r = -((dF_ddelta - film * remote_delta) / zeta - rho * log_zeta_delta) / 2
    assert simplify(rate_h.subs(rho, rate).subs(slopes) - along_h(rate)) == 0, "the slope of the rate in h is wrong"
    assert simplify(rate_r.subs(rho, rate).subs(slopes) - along_r(rate)) == 0, "the slope of the rate in r is wrong"
    # where the film has all of its weight, the rate is that of centres which are moved: its derived Jacobian
    moved, whole = controls.by_centres(), {film: 1, film_h: 0, d.dh_dt: -rho}
    gap_by = moved[controls.SLOPES[0]] + d.dh_dt / h + h * moved[controls.SLOPES[1]] / 2
    assert expand((rate_h + gap_by).subs(whole)) == 0, "the slope of the rate in h is not the Jacobian's"
    one, other, power = Function("f", positive=True)(h), Function("g", positive=True)(h), Symbol("n", real=True)
    product = 2 * one**power * other
    for rule in (relative_slope, _relative_slope_as_written):
        assert simplify(rule(product, h) - diff(product, h) / product) == 0, "the relative slope of zeta is wrong"
    by_h = along_h(residual) + diff(residual, rho) * rho_h
    by_r = along_r(residual) + diff(residual, rho) * rho_r
    # implicit function theorem: H(h(r), r) = 0
    gap = -H_r / H_h
    force = grip * ((dF_dh + dF_ddelta / 2) * h_r - dF_ddelta / 2) + grip_h * h_r * F_ela
    apart = {F_by_gap: grip * (dF_dh + dF_ddelta / 2) + grip_h * F_ela, F_by_distance: -grip * dF_ddelta / 2}
    for symbol, slope in ((F_by_gap, along_h(weighted)), (F_by_distance, along_r(weighted))):
        assert simplify(apart[symbol].subs(slopes) - slope) == 0, f"{symbol} is wrong"
    expected = apart[F_by_gap] * h_r + apart[F_by_distance]
    assert expand(force - expected) == 0, "the consistent tangent is wrong"
    equation = {rho: rate, rho_h: rate_h, rho_r: rate_r, H: residual, H_h: by_h, H_r: by_r, h_r: gap}
    return {**equation, F: weighted, F_r: force, **apart}


def _deflection() -> Expr:
    """Deflection at a distance of the centres: eq. 2, with the sum of the radii in the place of 2 R.

    Raises
    ------
    AssertionError
        If it is not what follows from eq. 2.
    """
    form = (overlap + h) / 2
    assert expand(d.generic_dynamics(general=True).X.subs(delta, form) - (2 * R - overlap)) == 0, "delta is wrong"
    return form


def contact_equations(law: ContactLaw, needs: ContactNeeds) -> Equations:
    """Everything there is to say about a contact, before any specialisation.

    Each quantity is in terms of h, overlap, g, s, y*, the parameters and earlier ones. What rules save is counted of an
    iteration and the tangent.
    """
    definitions = _definitions(law, needs, is_unequal(law, needs))
    return Equations(definitions, frozenset({H, H_h, Y_h, F_r, *tangential_outputs(needs)}))


def is_unequal(law: ContactLaw, needs: ContactNeeds) -> bool:
    """Whether the friction depends on the ratio of the radii."""
    return size_ratio.name in needs.varying and law.unequal != 1


def _definitions(law: ContactLaw, needs: ContactNeeds, unequal: bool) -> dict[Symbol, Expr]:
    # the names of a law's own parameters may be those of the kernel's variables
    law = in_code(law)
    values = partials(law)

    def relative(variable: Symbol) -> Expr:
        slopes = total(zeta, variable).subs(
            {**values, d.zeta_a: relative_slope(values[zeta], a), d.zeta_h: relative_slope(values[zeta], h)}
        )
        return sound(slopes)

    def of_law(symbol: Symbol, variable: Symbol) -> Expr:
        return sound(total(symbol, variable).subs(values))

    beside, carried, slope = carried_friction(law, needs.drag, unequal)
    generic = d.generic_dynamics(law.general)
    sliding: dict[Symbol, Expr] = {}
    if needs.tangential or needs.rubbing:
        sliding = {symbol: values[symbol] for symbol in (d.a_h, d.a_delta)}
    if needs.tangential and law.tangential is not None:
        sliding |= tangential_stage.tangential_definitions(law.tangential)
    if needs.rubbing and law.rubbing is not None:
        sliding |= coulomb.rubbing_definitions(law.rubbing)
    stage = stage_equation()
    return {
        delta: _deflection(),
        a: sound(law.a),
        F_ela: values[F_ela],
        **beside,
        zeta: carried * values[zeta],
        F_adh: values[F_adh],
        dF_ddelta: sound(2 * generic.stiffness.subs(values)),
        dF_dh: d.by_gap_of(law),
        C: dF_ddelta / 2,
        log_zeta_h: relative(h) + slope,
        log_zeta_delta: relative(delta),
        remote_h: of_law(F_adh, h),
        remote_delta: of_law(F_adh, delta),
        fading: FADING,
        started: Min(1, fading),
        ahead: Max(0, started),
        w: WEIGHT,
        w_h: diff(WEIGHT, ahead) * diff(FADING, h),
        film: Piecewise((w, pressed > 0), (1, True)),
        film_h: Piecewise((w_h, pressed > 0), (0, True)),
        grip: Piecewise((1, pressed > 0), (w, True)),
        grip_h: Piecewise((0, pressed > 0), (w_h, True)),
        Y: STATE,
        Y_h: diff(STATE, h),
        Y_hh: diff(STATE, h, 2),
        **stage,
        # H of pulled surfaces that are not deflected
        side: stage[H].subs(rho, stage[rho]).subs({film: 1, F_ela: 0}),
        friction: w * zeta,
        remote: w * F_adh,
        # beyond the range a pressed gap follows the centres, at a rate that the contact does not know
        dh_dt: -rho / film,
        **sliding,
    }


def carried_friction(law: ContactLaw, drag: bool, unequal: bool) -> tuple[dict[Symbol, Expr], Expr, Expr]:
    """The part of zeta that a contact carries, for its radii and beside drag, and the relative slope of that in h.

    Before them, what they are made of.

    Parameters
    ----------
    law : ContactLaw
    drag : bool
        Whether the particles have drags of their own beside the contact.
    unequal : bool
        Whether their radii differ.
    """
    beside: dict[Symbol, Expr] = {}
    carried, slope = S.One, S.Zero
    if unequal:
        beside = {of_radii: tidy(law.unequal), of_radii_h: _relative_slope_as_written(law.unequal, h)}
        carried, slope = of_radii, of_radii_h
    x = far_field.excess(law, unequal) if drag else None
    if x is not None:
        by_h = Add(*(tidy(diff(term, h)) for term in Add.make_args(x))) if unequal else sound(diff(x, h))
        beside |= {excess: x, excess_h: by_h}
        carried *= (excess + undragged) / (1 + excess)
        slope += excess_h * (1 - undragged) / ((excess + undragged) * (1 + excess))
    return beside, carried, slope


def _relative_slope_as_written(product: Expr, variable: Symbol) -> Expr:
    """Slope of a product relative to it, by factors and terms: sums of logarithms are not multiplied out."""
    factors = [factor.as_base_exp() for factor in Mul.make_args(product)]
    slopes = [(base, power) for base, power in factors if base.has(variable)]
    return Add(*(power * tidy(diff(base, variable)) / tidy(base) for base, power in slopes))


def tangential_outputs(needs: ContactNeeds) -> tuple[Symbol, ...]:
    """What the kernel gives of tangential motion: equal spheres have no lever."""
    rubbing = coulomb.OUTPUTS if needs.rubbing else ()
    if not needs.tangential:
        return rubbing
    given = tangential_stage.OUTPUTS if size_ratio.name in needs.varying else tangential_stage.OUTPUTS[:-1]
    sliding = (symbol for x in given for symbol in ((x,) if needs.explicit else (x, tangential_stage.ALONG[x])))
    return (*sliding, *rubbing)


def explicit_outputs(needs: ContactNeeds) -> tuple[Symbol, ...]:
    """What the kernel gives to explicit steps: the slope at fixed gap, frictions, and the remote force."""
    if not needs.explicit:
        return ()
    return (F_by_distance, friction, remote, *((tangential_stage.A_w,) if needs.tangential else ()))
