"""The kernel of many contacts: one implicit stage of every gap, at given distances of the centres.

Input: a law and what a scene needs of it. Output: a :class:`ContactIR`, what the templates ``contacts`` see.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

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
from softdyn.derive.printing import Assignment, operations, straight_line
from softdyn.derive.rules import RULES, Rule, Saving, specialised
from softdyn.derive.symbols import a, delta, size_ratio
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.law import ContactLaw

#: What ``state`` reports of a contact.
OUTPUTS = (delta, a, F, friction, remote, C, dF_dh, dh_dt, F_by_gap, F_by_distance)


@dataclass(frozen=True)
class ContactCode:
    """Straight-line code, and the rows of ``p`` (uniform) and ``q`` (varying) that it takes: (name, index)."""

    uniform: tuple[tuple[str, int], ...]
    varying: tuple[tuple[str, int], ...]
    lines: tuple[Assignment, ...]


@dataclass(frozen=True)
class ContactIR:
    """Everything a template of the contact kernel sees.

    Attributes
    ----------
    name, source, law_hash, declaration, fixed, savings, operations, sympy_version
        As in :class:`softdyn.derive.kernel.KernelIR`.
    uniform, varying : tuple of str
        What the arrays ``p`` (one number each) and ``q`` (one number for each contact) hold, in order.
    fading : bool
        Whether contacts have a range.
    outputs : tuple of str
        Rows of what ``state`` gives.
    tangential : tuple of str
        Rows of what ``contacts`` gives besides of tangential motion; empty without it.
    drag_outputs : tuple of str
        Rows of what ``drag`` gives of a particle; empty without drag.
    iteration, tangent, state, elastic, weight, side, drag : ContactCode
        H and dH/dy; the force and its consistent tangent; the outputs; the elastic force and its slope in h; the
        weight of what is stored, and its slope in h; what tells pressed contacts from pulled ones; the resistance of a
        particle alone.
    """

    #: Name of its templates.
    template: ClassVar[str] = "contacts"

    name: str
    source: str
    law_hash: str
    declaration: tuple[tuple[str, str], ...]
    fixed: tuple[tuple[str, str], ...]
    uniform: tuple[str, ...]
    varying: tuple[str, ...]
    fading: bool
    outputs: tuple[str, ...]
    tangential: tuple[str, ...]
    drag_outputs: tuple[str, ...]
    iteration: ContactCode
    tangent: ContactCode
    state: ContactCode
    elastic: ContactCode
    weight: ContactCode
    side: ContactCode
    drag: ContactCode
    savings: tuple[Saving, ...]
    operations: dict[str, dict[str, int]]
    sympy_version: str


def contact_ir(law: ContactLaw, needs: ContactNeeds, rules: tuple[Rule, ...] = RULES) -> ContactIR:
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
    names += (size_ratio.name,) if size_ratio.name in needs.varying and (needs.tangential or unequal) else ()
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
    names += (undragged.name,) if excess in definitions else ()
    sliding = tangential_outputs(needs)

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
    lines = {
        "iteration": straight_line([H, H_h, Y_h], definitions),
        "tangent": straight_line([F, F_r, *sliding], definitions),
        "state": straight_line(outputs, by_delta),
        "elastic": straight_line([F_ela, dF_dh], without_delta),
        "weight": straight_line([grip, grip_h], {k: e for k, e in by_delta.items() if k != delta})
        if needs.fading
        else [],
        "side": straight_line([side], undeflected) if needs.fading else [],
        "drag": straight_line(list(resisting), resisting),
    }
    lines = {part: [(name, for_lanes(text)) for name, text in code] for part, code in lines.items()}
    codes = {**code_names(law), undragged.name: undragged.name}
    uniform = tuple(name for name in names if name not in needs.varying)
    varying = tuple(name for name in names if name in needs.varying)

    def code(part: str) -> ContactCode:
        used = {name for _, text in lines[part] for name in re.findall(r"[A-Za-z_]\w*", text)}
        named = [[(codes[name], i) for i, name in enumerate(group)] for group in (uniform, varying)]
        taken = [tuple(pair for pair in group if pair[0] in used) for group in named]
        return ContactCode(taken[0], taken[1], tuple(lines[part]))

    named = ("a", "F_ela", "zeta", *(("unequal",) if unequal else ()), "F_adh")
    declared = tuple((name, str(getattr(law, name))) for name in named)
    by_name = tangential_expressions(law.tangential) if needs.tangential and law.tangential is not None else {}
    by_name |= {f"drag {name}": getattr(law.drag, name) for name in (symbol.name for symbol in resisting)}
    slides = tuple((name, str(expr)) for name, expr in by_name.items())
    return ContactIR(
        name=law.name,
        source=law.source or "no source given",
        law_hash=law_hash(law) + (f", {particles_hash(law)}" if needs.tangential or needs.drag or unequal else ""),
        declaration=(*declared, *slides),
        fixed=(),
        uniform=uniform,
        varying=varying,
        fading=needs.fading,
        outputs=tuple(symbol.name for symbol in outputs),
        tangential=tuple(symbol.name for symbol in sliding),
        drag_outputs=tuple(symbol.name for symbol in resisting),
        iteration=code("iteration"),
        tangent=code("tangent"),
        state=code("state"),
        elastic=code("elastic"),
        weight=code("weight"),
        side=code("side"),
        drag=code("drag"),
        savings=savings,
        operations={part: operations(text) for part, text in lines.items()},
        sympy_version=sympy.__version__,
    )
