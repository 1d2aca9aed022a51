"""What follows from a closure: what a solver, or a reader, needs besides its expression.

Of a drag: the force, its derivative by the slip, C_d, and the permeability of a bed of such grains as Re -> 0. The drag
on all grains balances -c grad p, as the pressure is shared: of each it is drag slip = -c grad(p) V/phi, V = 4 pi r^3/3;
and c slip = -k grad(p)/eta, so that k = c^2 eta V/(phi drag).
Of a viscosity: the intrinsic viscosity, the limit of (viscosity/eta - 1)/phi as phi -> 0, and the derivative by phi.
Of a permeability: the drag that makes it. Of settling: the slip that goes with it, as no volume flows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sympy import Expr, Rational, diff, pi

from softdyn.derive.closure import DRAG_COEFFICIENT, SLIP, Closure, Re, c, drag, eta, in_fractions, phi, r, slip
from softdyn.derive.closure_regimes import ClosureDiagram, discover_closure, in_words

#: Volume of a grain.
VOLUME = Rational(4, 3) * pi * r**3


@dataclass(frozen=True)
class Derived:
    """One thing that follows from a closure: its name, as LaTeX too, what it is in words, and in symbols."""

    name: str
    symbol: str
    says: str
    value: Expr


def permeability_of_drag(resistance: Expr) -> Expr:
    """Permeability of a bed of grains with a drag, force/velocity; and the drag of one with a permeability."""
    return c**2 * eta * VOLUME / (phi * resistance)


def derived(closure: Closure, diagram: ClosureDiagram | None = None) -> list[Derived]:
    """What follows from a closure, its expression first."""
    return list(_derived(closure, diagram))


def _derived(closure: Closure, diagram: ClosureDiagram | None) -> Iterator[Derived]:
    expr = closure.expression
    yield Derived(closure.gives, rf"\mathrm{{{closure.gives}}}", "as declared", expr)
    if closure.in_plane is not None:
        says = "on a disc, for each length along its axis, as declared"
        yield Derived("in_plane", r"\mathrm{drag}_2", says, closure.in_plane)
    if closure.gives == "drag":
        yield Derived("F", "F", "force on a grain", expr * slip)
        by_slip = expr.subs(slip, SLIP)
        slope = by_slip + Re * diff(by_slip, Re)  # Re is a multiple of the slip
        yield Derived("dF_dslip", r"\partial F/\partial\,\mathrm{slip}", "its derivative by the slip", slope)
        yield Derived("C_d", "C_d", "drag coefficient, F over pi r^2 rho slip^2/2", DRAG_COEFFICIENT.subs(drag, expr))
        for regime in (diagram or discover_closure(closure)).regimes:
            if regime.form is not None and regime.towards >= 0 and not regime.form.state.has(Re):
                bed = in_words(permeability_of_drag(regime.form.state))
                yield Derived("k", "k", f"permeability of a bed as Re -> 0 ({regime.name})", bed)
    if closure.gives == "viscosity":
        slope = diff(in_fractions(closure, expr, phi), phi)
        yield Derived("dviscosity_dphi", r"\partial\,\mathrm{viscosity}/\partial\phi", "its derivative by phi", slope)
        for regime in (diagram or discover_closure(closure)).regimes:
            dilute = regime.ends.get("dilute")
            for first in () if dilute is None or dilute.form is None else dilute.form.corrections:
                if not (first / phi).has(phi):
                    yield Derived("intrinsic", r"[\eta]", "intrinsic viscosity, as phi -> 0", first / phi)
    if closure.gives == "permeability":
        yield Derived("drag", r"\mathrm{drag}", "drag on a grain that makes it", permeability_of_drag(expr))
    if closure.gives == "settling":
        yield Derived("slip", r"\mathrm{slip}", "slip of the grains, over the speed of one alone", expr / c)
