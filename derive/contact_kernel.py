"""The kernel of many contacts: one implicit stage of every gap, at given distances of the centres.

Input: a law and what a scene needs of it. Output: a :class:`KernelIR` of the kind ``contacts``. Its arrays are ``p``,
one number each, and ``q``, one number for each contact.

Its functions are H and dH/dy; the force and its consistent tangent, with what there is of tangential motion; the
outputs; the elastic force and its slope in h; the weight of what is stored, and its slope in h; what tells pressed
contacts from pulled ones; the resistance of a particle alone. Its settings:

fading : bool
    Whether contacts have a range.
tangential : tuple of str
    Rows of what ``contacts`` gives besides of tangential motion; empty without it.
more : tuple of str
    All rows of what it gives besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy
from sympy import Expr, Piecewise, Symbol

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
    tangential_expressions,
)
from softdyn.derive.printing import straight_line
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.derive.symbols import a, delta, size_ratio
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.law import ContactLaw

#: What ``state`` reports of a contact.
OUTPUTS = (delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance)


def contact_ir(law: ContactLaw, needs: ContactNeeds, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive the contact kernel of a law, specialise it, and lower it to straight-line code.

    With fewer ``rules`` than there are, the kernel computes the same, and more than it needs.

    Raises
    ------
    LawError
        If the law is rigid or dry: then a contact has no gap state, or no deflection; if a varying parameter is not the
        law's; or if tangential motion is asked for, and the law does not declare any.
    """
    names = tuple(symbol.name for symbol in parameters_of(law, needs.tangential, needs.drag))
    unequal = is_unequal(law, needs)
    faults = [
        f"{name!r} is no parameter; there are {', '.join(names)}"
        for name in needs.varying
        if name not in (*names, size_ratio.name)
    ]
    if is_rigid(law) or is_dry(law):
        faults.append(
            "many particles need both an elastic force and a friction; for nearly rigid particles choose a large E"
        )
    if needs.tangential and law.tangential is None:
        faults.append(
            "tangential motion is asked for, and the law declares none: give it tangential=Tangential(sliding=..., "
            "k_t=...), or leave [contacts] tangential out"
        )
    if faults:
        raise LawError(law.name, tuple(faults))
    equations, savings = specialised(contact_equations(law, needs), needs, rules)
    definitions = equations.definitions
    names += (size_ratio.name,) if any(expr.has(size_ratio) for expr in definitions.values()) else ()
    names += (undragged.name,) if excess in definitions else ()
    sliding = tangential_outputs(needs)
    more = (*sliding, *explicit_outputs(needs))

    resisting: dict[Symbol, Expr] = {}
    if needs.drag:
        declared_drag = drag_expressions(in_code(law).drag)
        resisting = {Symbol(name, real=True): expr for name, expr in declared_drag.items()}
        resisting = resisting if needs.tangential else {k: e for k, e in resisting.items() if k.name != "rotation"}
    outputs = (*OUTPUTS, *(tangential_stage.STATE_OUTPUTS if needs.tangential else ()))
    without_delta = {symbol: expr for symbol, expr in definitions.items() if symbol != delta}
    told = {pressed: Piecewise((1, delta >= 0), (0, True)), **without_delta}
    by_delta = {delta: definitions[delta], **told}
    undeflected = {symbol: expr.subs(delta, 0) for symbol, expr in without_delta.items()}
    weight = {symbol: expr for symbol, expr in by_delta.items() if symbol != delta}
    codes = {**code_names(law), undragged.name: undragged.name}
    uniform = tuple(name for name in names if name not in needs.varying)
    varying = tuple(name for name in names if name in needs.varying)
    coded = {"p": [codes[name] for name in uniform], "q": [codes[name] for name in varying]}
    given = ("h", "overlap", "g", "s", "y_star", "reach", "pressed", "delta")

    def code(targets: Sequence[Symbol], definitions: dict[Symbol, Expr]) -> Function:
        lines = [(name, for_lanes(text)) for name, text in straight_line(targets, definitions)]
        return function(lines, [symbol.name for symbol in targets], given, coded)

    declared = ("a", "F_ela", "zeta", *(("unequal",) if unequal else ()), "F_adh")
    by_name = {name: getattr(law, name) for name in declared}
    by_name |= tangential_expressions(law.tangential) if needs.tangential and law.tangential is not None else {}
    by_name |= {f"drag {symbol.name}": getattr(law.drag, symbol.name) for symbol in resisting}
    beside = f", {particles_hash(law)}" if needs.tangential or needs.drag or unequal else ""
    return KernelIR(
        kind="contacts",
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
            "iteration": code([H, H_h, Y_h], definitions),
            "tangent": code([F, F_r, *more], definitions),
            "state": code(outputs, by_delta),
            "elastic": code([F_ela, dF_dh], without_delta),
            "weight": code([grip, grip_h] if needs.fading else [], weight),
            "side": code([side] if needs.fading else [], undeflected),
            "drag": code(list(resisting), resisting),
        },
        settings={
            "fading": needs.fading,
            "tangential": tuple(symbol.name for symbol in sliding),
            "more": tuple(symbol.name for symbol in more),
        },
        savings=savings,
    )
