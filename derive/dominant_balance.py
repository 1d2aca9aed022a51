"""The quantities of a law in one cone of scalings: each as a series, by dominant balance.

Input: a law, and a cone of scalings of h, delta and, where they vary, the law's own lengths and forces. Output: the
series of a, F, zeta, F_adh, C, D, dh/dt, dX/dt, with F = F_ela(a(h, delta), delta), so that nothing is inverted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from sympy import DiracDelta, Expr, S, Symbol, diff
from sympy import expand as multiplied_out

from softdyn.derive import dynamics as d
from softdyn.derive.asymptotics import (
    KEPT,
    CancelError,
    OutOfEffortError,
    Scale,
    Series,
    SplitError,
    UndecidedError,
    expand,
    leading,
    scale_of,
)
from softdyn.derive.cones import Cone, Normal, split
from softdyn.derive.law import is_dry, is_rigid
from softdyn.derive.patience import within
from softdyn.derive.soundness import at_side, cancelling_sums
from softdyn.derive.symbols import E, F, R, a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

Found = TypeVar("Found")

#: The size of delta, on either side.
size = Symbol("delta", positive=True)

#: The quantities, in the order in which they follow from each other.
QUANTITIES = ("a", "F", "zeta", "F_adh", "C", "D", "dh_dt", "dX_dt")

#: Cones that a search may cut the plane into.
MOST_CONES = 400


@lru_cache(maxsize=32)
def definitions(law: ContactLaw) -> dict[Symbol, Expr]:
    """Every quantity of a law in terms of h, delta and those before it; dX/dt at constant force."""
    generic = d.generic_dynamics(law.general)
    net = Symbol("net", real=True)

    def slope(variable: Symbol) -> Expr:
        # in the form that cancels least: what cancels in a sum costs terms of its series
        return d.slope_of_radius(law, variable)

    dX_dt = Symbol("dX_dt", real=True)
    if is_dry(law):
        return {
            a: law.a,
            # where surfaces touch
            F: law.F_ela + law.F_adh.subs(h, 0),
            d.F_a: _slope(law.F_ela, a),
            d.F_delta: _slope(law.F_ela, delta),
            d.a_delta: slope(delta),
            d.C: generic.stiffness,
        }
    remote = {d.F_adh: law.F_adh, d.zeta: law.zeta}
    motion = {net: F - d.F_adh if law.F_adh != 0 else F, d.dh_dt: -net / d.zeta}
    if is_rigid(law):
        # there is no deflection: delta stands for F/(E R)
        return {a: law.a, F: E * R * delta, **remote, d.D: d.zeta, **motion, dX_dt: d.dh_dt}
    return {
        a: law.a,
        F: law.F_ela,
        **remote,
        d.F_a: _slope(law.F_ela, a),
        d.F_delta: _slope(law.F_ela, delta),
        **({d.F_h: _slope(law.F_ela, h)} if law.general else {}),
        d.a_h: slope(h),
        d.dF_dh: generic.by_gap,
        d.a_delta: slope(delta),
        d.C: generic.stiffness,
        d.D: generic.friction,
        **motion,
        dX_dt: -net / d.D,
    }


@lru_cache(maxsize=64)
def _slope(expr: Expr, variable: Symbol) -> Expr:
    """Derivative away from delta = 0, where that of sign(delta) is 0."""
    return diff(expr, variable).replace(DiracDelta, lambda *_: S.Zero)


@lru_cache(maxsize=64)
def definitions_at(law: ContactLaw, side: int) -> dict[Symbol, Expr]:
    """The same on one side of delta = 0, without the branches of the other, in the size of delta.

    A sum that cancels less with the radius written out has it so: a^2 - 2 R h is a series that cancels, 2 R delta is
    one term.
    """
    found = {symbol: at_side(expr, side * size) for symbol, expr in definitions(law).items()}
    return {symbol: expr if symbol == a else _with_radius(expr, found[a]) for symbol, expr in found.items()}


def _with_radius(expr: Expr, radius: Expr) -> Expr:
    if not expr.has(a):
        return expr
    expr = expr.func(*(_with_radius(part, radius) for part in expr.args)) if expr.args else expr
    if expr.is_Add and expr.has(a) and cancelling_sums(expr):
        written = multiplied_out(expr.xreplace({a: radius}), power_base=False, power_exp=False, log=False)
        if cancelling_sums(written) < cancelling_sums(expr) and written.count_ops() <= expr.count_ops():
            return written
    return expr


def series_of(
    law: ContactLaw,
    scale: Scale,
    side: int,
    wanted: Iterable[str] = QUANTITIES,
    known: dict[Symbol, Series | UndecidedError] | None = None,
) -> dict[str, Series | UndecidedError]:
    """Series of the quantities wanted, and of what they follow from, by name; or why there is none.

    Parameters
    ----------
    law : ContactLaw
    scale : Scale
    side : int
        1 in compression, -1 in tension.
    wanted : iterable of str
        Names of quantities.
    known : dict from Symbol to Series or UndecidedError, optional
        Those found before with the same scale: they are not found again, and those found now are added.

    Raises
    ------
    SplitError
        If the cone must be cut.
    """
    known = {} if known is None else known
    needed = _needed(definitions(law), set(wanted))
    here = scale.knowing(delta, Series({order: side * c for order, c in scale.known[size].terms.items()}), side * size)
    found: dict[str, Series | UndecidedError] = {}
    unknown: dict[Symbol, UndecidedError] = {}
    for symbol, expr in definitions_at(law, side).items():
        if symbol not in needed:
            continue
        outcome = known.get(symbol)
        if outcome is None:
            try:
                for missing in sorted(expr.free_symbols & unknown.keys(), key=str):
                    raise unknown[missing]
                outcome = expand(expr, here)
                if expr != 0 and (outcome.terms or outcome.remainder):
                    leading(outcome, symbol)
            except SplitError:
                raise
            except UndecidedError as reason:
                outcome = reason
            if not isinstance(outcome, OutOfEffortError):  # what is left of the effort is another the next time
                known[symbol] = outcome
        found[symbol.name] = outcome
        if isinstance(outcome, Series):
            here = here.knowing(symbol, outcome, expr)
        else:
            unknown[symbol] = outcome
    return found


def _needed(equations: Mapping[Symbol, Expr], wanted: set[str]) -> set[Symbol]:
    needed: set[Symbol] = set()
    for symbol in reversed(list(equations)):
        if symbol.name in wanted or symbol in needed:
            needed |= {symbol} | (equations[symbol].free_symbols & equations.keys())
    return needed


def contact_series(
    law: ContactLaw,
    cone: Cone,
    directions: Mapping[Symbol, Normal],
    side: int,
    kept: Sequence[int] = (1, KEPT),
    effort: int | None = None,
    wanted: Iterable[str] = QUANTITIES,
) -> dict[str, Series | UndecidedError]:
    """Series of the quantities of a law in a cone; with more terms where the leading ones cancel.

    Parameters
    ----------
    directions : mapping from Symbol to Normal
        Exponents of h, of the size of delta and of the parameters that vary, as linear forms of the axes.
    side : 1 or -1
        Sign of delta.
    kept : sequence of int
        Terms to keep, at first, and where that is not enough.
    effort : int, optional
        Operations beyond which what is not found yet is given up.
    """
    found: dict[str, Series | UndecidedError] = {}
    with within(effort, OutOfEffortError):
        for terms in kept:
            found = series_of(law, scale_of(cone, directions, terms), side, wanted)
            if not any(isinstance(series, CancelError) for series in found.values()):
                break
    return found


def settle(cones: Iterable[Cone], find: Callable[[Cone], Found]) -> list[tuple[Cone, Found]]:
    """Cut cones until something can be found in each piece.

    Raises
    ------
    UndecidedError
        As ``find`` does, but for SplitError; or if there are more than MOST_CONES pieces.
    """
    settled: list[tuple[Cone, Found]] = []
    waiting = list(cones)
    while waiting:
        cone = waiting.pop()
        try:
            settled.append((cone, find(cone)))
        except SplitError as competing:
            above, below = split(cone, competing.values)
            waiting += above + below
        if len(settled) + len(waiting) > MOST_CONES:
            raise UndecidedError(f"the scalings fall into more than {MOST_CONES} cones")
    return settled
