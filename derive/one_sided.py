"""The two one-sided limits of a law: no deflection, or no gap.

Input: a law. Output: what is left of it as E -> infinity (rigid spheres, lubrication alone), or as eta -> 0 (dry
contact, elasticity alone), a law again. Each rule first sees to it that the law has that limit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy import Dummy, Expr, oo, powsimp, simplify

from softdyn.derive.asymptotics import UndecidedError, expand, leading, scale_of
from softdyn.derive.dominant_balance import size
from softdyn.derive.law import ContactLaw
from softdyn.derive.soundness import of_pressed, sides_of
from softdyn.derive.symbols import E, delta, eta, h
from softdyn.errors import LawError

if TYPE_CHECKING:
    from sympy import Symbol


def rigid(law: ContactLaw, **about: Any) -> ContactLaw:
    """Limit E -> infinity: delta -> 0 under any force, a -> a(h, 0); dX/dt = dh/dt = -(F - F_adh)/zeta.

    Parameters
    ----------
    law : ContactLaw
    **about
        Fields of the new law: name, source, description, limits.

    Raises
    ------
    LawError
        If the elastic force is not proportional to E, or if E stands elsewhere in the law.
    """
    faults = []
    if not _proportional(law.F_ela, E):
        faults.append(f"F_ela = {law.F_ela} is not proportional to E: delta need not vanish as E -> infinity")
    faults += [
        f"{name} = {expr} depends on E: it has no limit here"
        for name, expr in (("a", law.a), ("zeta", law.zeta), ("F_adh", law.F_adh))
        if expr.has(E)
    ]
    if faults:
        raise LawError(f"rigid({law.name})", tuple(faults))
    undeflected = {name: getattr(law, name).subs(delta, 0) for name in ("a", "zeta", "F_adh")}
    return _left(law, about, **undeflected, F_ela=oo)


def dry(law: ContactLaw, **about: Any) -> ContactLaw:
    """Limit eta -> 0: the gap closes at once, h -> 0, a -> a(0, delta); dX/dt = -(dF/dt)/C.

    Only a film holds surfaces that are pulled: a law with a branch for these keeps that of pressed ones alone.

    Parameters
    ----------
    law : ContactLaw
    **about
        Fields of the new law: name, source, description, limits.

    Raises
    ------
    LawError
        If the friction is not proportional to eta, if there is a remote force, which may hold the gap open, or if a has
        no limit as h -> 0.
    """
    faults = []
    branched = sides_of(law.a, law.F_ela) is not None
    wide, elastic = (of_pressed(expr) for expr in (law.a, law.F_ela))
    if not _proportional(law.zeta, eta):
        faults.append(f"zeta = {law.zeta} is not proportional to eta: it need not vanish with eta")
    if law.F_adh != 0:
        faults.append(f"F_adh = {law.F_adh} may hold a gap open: it need not close as eta -> 0")
    faults += [
        f"{name} = {expr} depends on eta" for name, expr in (("a", law.a), ("F_ela", law.F_ela)) if expr.has(eta)
    ]
    try:
        radius = _without_gap(wide, (1,) if branched else (1, -1))
    except UndecidedError as reason:
        faults.append(f"a = {law.a} has no limit as h -> 0: {reason}")
    if faults:
        raise LawError(f"dry({law.name})", tuple(faults))
    return _left(law, about, a=radius, F_ela=elastic, zeta=0, F_adh=0)


def _proportional(expr: Expr, symbol: Symbol) -> bool:
    factor = Dummy("factor", positive=True)
    return bool(simplify(powsimp(expr.subs(symbol, factor * symbol) / factor) - expr) == 0)


def _without_gap(radius: Expr, signs: tuple[int, ...]) -> Expr:
    """Limit of a as h -> 0 at given delta, the same for the signs of delta asked for."""
    sides = []
    for side in signs:
        scale = scale_of(((1,),), {h: (1,)}, kept=1)
        order, coefficient = leading(expand(radius.subs(delta, side * size), scale), "a")
        if any(order):
            raise UndecidedError(f"it goes as {coefficient}")
        sides.append(coefficient)
    if sides[0] != sides[-1]:
        raise UndecidedError(f"it is {sides[0]} in compression, {sides[1]} in tension")
    return sides[0].subs(size, abs(delta))


def _left(law: ContactLaw, about: dict[str, Any], **expressions: Any) -> ContactLaw:
    """Return a law of what is left, with those of the parameters that are left in it."""
    used = {symbol for expr in expressions.values() if isinstance(expr, Expr) for symbol in expr.free_symbols}

    def kept(values: Any) -> dict[Any, Any]:
        return {symbol: value for symbol, value in values.items() if symbol in used}

    own = {"parameters": kept(law.parameters), "ranges": kept(law.ranges), "typical": kept(law.typical)}
    return ContactLaw(**{"source": law.source, **own, **expressions, **about})
