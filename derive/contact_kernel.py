"""The kernel of many contacts: one implicit stage of every gap, at given distances of the centres.

Input: a law and what a scene needs of it. Output: a :class:`KernelIR` of the kind ``contacts``. Its arrays are ``p``,
one number each, and ``q``, one number for each contact.

Its functions are H and dH/dy; the force and its consistent tangent, with what there is of tangential motion; the
outputs; the elastic force and its slope in h; the weight of what is stored, and its slope in h; what tells pressed
contacts from pulled ones; the resistance of a particle alone. Its settings:

fading : bool
    Whether contacts have a range.
rubbing : bool
    Whether surfaces rub: then there is a function more, the return map of Coulomb friction.
more : tuple of str
    Rows of what ``contacts`` gives besides: of tangential motion, and to explicit steps.

Dry and rigid laws have no gap state. Their kernel is of the kind ``gapless``, with the same arrays and settings, and
``rigid``; its functions are gap, force and tangent; the outputs; the elastic force; the resistance of a particle alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy
from sympy import Expr, Piecewise, S, Symbol

from softdyn.derive import coulomb
from softdyn.derive import tangential as tangential_stage
from softdyn.derive.contact_equations import (
    F,
    F_by_distance,
    F_by_gap,
    F_r,
    H,
    H_h,
    Y_h,
    contact_equations,
    dh_dt,
    excess,
    explicit_outputs,
    friction,
    grip,
    grip_h,
    is_unequal,
    pressed,
    remote,
    side,
    tangential_outputs,
    undragged,
)
from softdyn.derive.dynamics import C, F_ela, dF_dh
from softdyn.derive.elementary import for_lanes
from softdyn.derive.equations import followed
from softdyn.derive.gapless_equations import gapless_equations
from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function
from softdyn.derive.law import (
    code_names,
    drag_expressions,
    in_code,
    is_dry,
    is_rigid,
    law_hash,
    parameters_of,
    particles_hash,
    rubbing_expressions,
    tangential_expressions,
)
from softdyn.derive.printing import straight_line
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.derive.symbols import a, delta, h, size_ratio
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.law import ContactLaw

#: What the templates provide to the code of functions.
GIVEN = (
    "h", "overlap", "g", "s", "y_star", "rate", "pace", "reach", "pressed", "delta", "load", "size", "slip_rate", "mu",
)  # fmt: skip
#: What ``state`` reports of a contact.
OUTPUTS = (delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance)


def contact_ir(law: ContactLaw, needs: ContactNeeds, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive the contact kernel of a law, specialise it, and lower it to straight-line code.

    With fewer ``rules`` than there are, the kernel computes the same, and more than it needs. A rigid or dry law has no
    gap state: its kernel is of the kind ``gapless``, see :mod:`softdyn.derive.gapless_equations`.

    Parameters
    ----------
    law : ContactLaw
    needs : ContactNeeds
    rules : tuple of Rule

    Raises
    ------
    LawError
        If a varying parameter is not the law's; or if tangential motion is asked for, and the law does not declare any.
    """
    names = tuple(symbol.name for symbol in parameters_of(law, needs.tangential, needs.drag, needs.rubbing))
    unequal, gapless = is_unequal(law, needs), is_rigid(law) or is_dry(law)
    faults = [
        f"{name!r} is no parameter; there are {', '.join(names)}"
        for name in needs.varying
        if name not in (*names, size_ratio.name)
    ]
    if needs.tangential and law.tangential is None:
        faults.append(
            "tangential motion is asked for, and the law declares none: give it tangential=Tangential(sliding=..., "
            "k_t=...), or leave [contacts] tangential out"
        )
    if needs.rubbing and law.rubbing is None and (law.tangential is None or not is_dry(law)):
        faults.append(
            "[friction] is asked for, and the law says nothing of surfaces that touch: give it "
            "rubbing=Rubbing(load=..., k_t=...), a load that they bear through their film; of a dry law, "
            "tangential=Tangential(sliding=oo, k_t=...)"
        )
    if gapless and needs.explicit:
        faults.append(
            "steps explicit in the positions are for laws with a film, whose gap is a state: an elastic force and a "
            "friction"
        )
    if faults:
        raise LawError(law.name, tuple(faults))
    equations, savings = specialised((gapless_equations if gapless else contact_equations)(law, needs), needs, rules)
    definitions = (followed(equations) if gapless else equations).definitions
    names += (size_ratio.name,) if any(expr.has(size_ratio) for expr in definitions.values()) else ()
    names += (undragged.name,) if excess in definitions else ()

    resisting: dict[Symbol, Expr] = {}
    if needs.drag:
        declared_drag = drag_expressions(in_code(law).drag)
        resisting = {Symbol(name, real=True): expr for name, expr in declared_drag.items()}
        turning = needs.tangential or needs.rubbing
        resisting = resisting if turning else {k: e for k, e in resisting.items() if k.name != "rotation"}
    codes = {**code_names(law), undragged.name: undragged.name}
    uniform = tuple(name for name in names if name not in needs.varying)
    varying = tuple(name for name in names if name in needs.varying)
    coded = {"p": [codes[name] for name in uniform], "q": [codes[name] for name in varying]}

    def code(targets: Sequence[Symbol], definitions: dict[Symbol, Expr]) -> Function:
        lines = [(name, for_lanes(text)) for name, text in straight_line(targets, definitions)]
        return function(lines, [symbol.name for symbol in targets], GIVEN, coded)

    parts = (_gapless_parts if gapless else _film_parts)(definitions, needs)
    by_name = {name: getattr(law, name) for name in ("a", "F_ela", "zeta", *(("unequal",) if unequal else ()), "F_adh")}
    by_name |= {"dashpot": law.dashpot} if law.dashpot != 0 else {}
    by_name |= tangential_expressions(law.tangential) if needs.tangential and law.tangential is not None else {}
    by_name |= {f"drag {symbol.name}": getattr(law.drag, symbol.name) for symbol in resisting}
    by_name |= rubbing_of_law(law) if needs.rubbing else {}
    more = needs.tangential or needs.rubbing or needs.drag or unequal or law.dashpot != 0
    beside = f", {particles_hash(law)}" if more else ""
    return KernelIR(
        kind="gapless" if gapless else "contacts",
        name=law.name,
        provenance=Provenance(
            title=f"Contact law {law.name}:",
            source=law.source or "no source given",
            declared="law",
            fingerprint=f"{law_hash(law)}{beside}",
            declaration=tuple((name, str(expr)) for name, expr in by_name.items()),
            sympy_version=sympy.__version__,
        ),
        arrays={"p": uniform, "q": varying},
        functions={
            **{name: code(targets, within) for name, (targets, within) in parts.items()},
            "drag": code(list(resisting), resisting),
            **({"rub": code(coulomb.MAP, _bounded(law))} if needs.rubbing else {}),
        },
        settings={
            "fading": needs.fading,
            "more": tuple(symbol.name for symbol in (*tangential_outputs(needs), *explicit_outputs(needs))),
            "rubbing": needs.rubbing,
            **({"rigid": is_rigid(law)} if gapless else {}),
        },
        savings=savings,
    )


#: What functions are asked for, and the definitions that they follow from.
Parts = dict[str, tuple[Sequence[Symbol], dict[Symbol, Expr]]]


def _outputs(needs: ContactNeeds) -> tuple[Symbol, ...]:
    """What ``state`` reports."""
    sliding = tangential_stage.STATE_OUTPUTS if needs.tangential else ()
    return (*OUTPUTS, *sliding, *(coulomb.STATE_OUTPUTS if needs.rubbing else ()))


def _bounded(law: ContactLaw) -> dict[Symbol, Expr]:
    """The return map of a law's surfaces that rub."""
    return coulomb.bounded_force(S.One if law.rubbing is None else in_code(law).rubbing.mu)  # type: ignore[union-attr]


def rubbing_of_law(law: ContactLaw) -> dict[str, Expr]:
    """What is declared of surfaces that rub, by the names that the header of a kernel has."""
    if law.rubbing is None:
        return {} if law.tangential is None else {"k_t": law.tangential.k_t}
    return {f"rubbing {name}": expr for name, expr in rubbing_expressions(law.rubbing).items()}


def _film_parts(definitions: dict[Symbol, Expr], needs: ContactNeeds) -> Parts:
    """Functions of contacts whose gap is a state of its own."""
    without_delta = {symbol: expr for symbol, expr in definitions.items() if symbol != delta}
    told = {pressed: Piecewise((1, delta >= 0), (0, True)), **without_delta}
    by_delta = {delta: definitions[delta], **told}
    undeflected = {symbol: expr.subs(delta, 0) for symbol, expr in without_delta.items()}
    weight = {symbol: expr for symbol, expr in by_delta.items() if symbol != delta}
    return {
        "iteration": ([H, H_h, Y_h], definitions),
        "tangent": ([F, F_r, *tangential_outputs(needs), *explicit_outputs(needs)], definitions),
        "state": (_outputs(needs), by_delta),
        "elastic": ([F_ela, dF_dh], without_delta),
        "weight": ([grip, grip_h] if needs.fading else [], weight),
        "side": ([side] if needs.fading else [], undeflected),
    }


def _gapless_parts(definitions: dict[Symbol, Expr], needs: ContactNeeds) -> Parts:
    """Functions of contacts whose gap and deflection follow from the distance."""
    return {
        "force": ([h, F, F_r, *tangential_outputs(needs)], definitions),
        "state": (_outputs(needs), definitions),
        "elastic": ([F_ela], {symbol: definitions[symbol] for symbol in (a, F_ela)}),
    }
