"""The kernel of a pair: what its gap and deflection do under a force, or as the centres are moved.

Input: a law and what a scene needs of its kernel. Output: a :class:`KernelIR` of the kind ``pair``.

Its functions are the terms of Newton's iteration for delta that the gap alone enters; a step of it, (F_ela - F) over
dF_ela/d(delta); the rates of the state; their Jacobian; the outputs; what the drive is at any time, with its rate; and
that of the two which the integration needs. Its settings:

radius : str
    R as text: where Newton's iteration starts if the linear response is larger.
drive : "constant", "table" or "expression"
control : "force", "position", "velocity" or "spring"
    What the drive gives.
drive_text : str
    The expression of what is given, if it is one, with its constants named c0, c1, ...
constants : int
    How many constants the array ``c`` holds, with the choices between its smooth parts.
program, program_numbers : tuple of float, int
    What is given, as its enclosure takes it; how many of its operations are numbers.
deflection : "either", "compression" or "tension"
rigid : bool
    Whether the particles do not deform.
outputs : tuple of str
inputs : tuple of str
    What the outputs depend on besides h, delta and the parameters: "F", "dF_dt", "dX_dt".
components : int
    Of the state: ln h, and delta unless the force is given.
width : int
    Numbers that describe a step: its start, its length, what ends it; of each component its value and its stages. Under
    a constant force there is room for a panel: the nodes' times, and its length in ln h. Last, the estimated errors
    within the step, of ln h at a given time and of the time at a given gap.
anchored : bool
    Whether F_ela vanishes at delta = 0.
rising : bool
    Whether F_ela is known to rise with delta at any gap and deflection.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import sympy
from sympy import Add, Dummy, Expr, Mul, Rational, Symbol, together

from softdyn.derive.controls import BY_FORCE, SLOPES, compliance
from softdyn.derive.drive import DriveCode, drive_code
from softdyn.derive.dynamics import F_ela, ddelta_dt, dF_ddelta, dF_dt, dh_dt, dX_dt
from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function, names_in
from softdyn.derive.law import (
    code_names,
    in_code,
    is_anchored,
    is_rigid,
    law_hash,
    parameters_of,
    range_text,
    ranges_of,
)
from softdyn.derive.pair_equations import (
    OUTPUTS,
    Deflection,
    Needs,
    integrated,
    output_name,
    outputs_of,
    with_slopes,
)
from softdyn.derive.parameter_slopes import sensitive_outputs
from softdyn.derive.printing import KINDS, Assignment, operations, print_expression, straight_line
from softdyn.derive.radau import PANEL_NODES, STAGES
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.derive.symbols import F, a, delta, h
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

NEWTON = Symbol("newton", real=True)
#: Of a division, a root and a function, over that of an addition.
COSTS = {"div": 8, "sqrt": 8, "call": 20}


def kernel_ir(law: ContactLaw, needs: Needs, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive a law's equations, specialise them to a scene's needs, and lower them to straight-line code.

    With fewer ``rules`` than there are, the kernel computes the same, and more than it needs.

    Parameters
    ----------
    law : ContactLaw
    needs : Needs
    rules : tuple of Rule

    Raises
    ------
    LawError
        If a fixed parameter or an output is not the law's.
    """
    names = [symbol.name for symbol in parameters_of(law)]
    outputs = outputs_of(law) if needs.outputs is None else needs.outputs
    _require_known(law, needs, outputs, names)
    if not is_anchored(law):  # the sign of the force is not that of the deflection
        needs = replace(needs, deflection="either")
    # in the code, the names of a law's own parameters are none of anything else
    codes = code_names(law)
    sensitive = tuple(codes.get(name, name) for name in needs.sensitive)
    own = replace(needs, fixed={codes[name]: value for name, value in needs.fixed.items()})
    if sensitive:
        outputs = (*outputs, *sensitive_outputs(needs.control == "force", sensitive))
        own = replace(own, outputs=outputs)
    expression = isinstance(needs.drive, tuple)
    equations, savings = specialised(with_slopes(in_code(law), needs.control, expression, sensitive), own, rules)
    definitions = equations.definitions
    # rigid particles transmit any force, without a deflection
    rigid = is_rigid(law)
    rising = rigid or rises(definitions, needs.deflection)
    gap_terms, terms, newton = ([], (), []) if rigid else newton_step(definitions, rising)
    by_force = needs.control == "force"
    rates = (dh_dt,) if by_force else (dh_dt, ddelta_dt)
    slopes = tuple(symbol for symbol in integrated(needs.control, expression) if symbol in (*SLOPES, BY_FORCE))
    asked = tuple(_symbol_named(definitions, name) for name in outputs)
    # what the integrator needs of the drive is its value, or the rate at which it moves the centres
    only = F if needs.control in ("force", "velocity") else dF_dt
    drive = drive_code(needs.drive, only == F) if isinstance(needs.drive, tuple) else DriveCode()
    left = {symbol.name for expr in definitions.values() for symbol in expr.free_symbols}
    parameters = tuple(name for name in names if name not in needs.fixed or codes[name] in left)
    coded = tuple(codes[name] for name in parameters)
    if compliance.name in left:
        parameters += (compliance.name,)
        coded += (compliance.name,)
    state = ("h", "delta", *((F.name, dF_dt.name) if by_force else (dX_dt.name,)))

    def code(lines: list[Assignment], gives: Iterable[str], given: Iterable[str] = state) -> Function:
        return function(lines, gives, given, {"p": coded})

    def of_state(targets: tuple[Symbol, ...]) -> Function:
        return code(straight_line(targets, definitions), (symbol.name for symbol in targets))

    quantities = of_state(asked)
    step = () if rigid else (NEWTON.name,) if rising else (NEWTON.name, dF_ddelta.name)
    return KernelIR(
        kind="pair",
        name=law.name,
        provenance=provenance_of(law, tuple(sorted(needs.fixed.items()))),
        arrays={"p": parameters},
        functions={
            "gap_terms": code(gap_terms, terms),
            "newton": code(newton, step, (*terms, delta.name, F.name)),
            "gap_rate": of_state(rates),
            "slopes": of_state(slopes),
            "quantities": quantities,
            "force": code(drive.force, (F.name, dF_dt.name), ("t", "c")),
            "given": code(drive.given, (only.name,), ("t", "c")),
        },
        settings={
            "radius": print_expression(Rational(needs.fixed["R"])) if "R" in needs.fixed else "p[0]",
            "drive": "expression" if expression else str(needs.drive),
            "control": needs.control,
            "drive_text": drive.text,
            "constants": drive.constants,
            "program": drive.program,
            "program_numbers": drive.numbers,
            "deflection": needs.deflection,
            "rigid": rigid,
            "outputs": outputs,
            "inputs": tuple(name for name in quantities.takes if name in state[2:]),
            "components": len(rates),
            "width": 7 + PANEL_NODES if by_force and needs.drive == "constant" else 5 + (STAGES + 1) * len(rates),
            "anchored": is_anchored(law),
            "rising": rising,
        },
        savings=savings,
    )


def provenance_of(law: ContactLaw, fixed: tuple[tuple[str, str], ...] = ()) -> Provenance:
    """Where a law comes from, its fingerprint, and its four expressions."""
    return Provenance(
        title=f"Contact law {law.name}:",
        source=law.source or "no source given",
        declared="law",
        fingerprint=law_hash(law),
        declaration=tuple((name, str(getattr(law, name))) for name in ("a", "F_ela", "zeta", "F_adh")),
        fixed=fixed,
        sympy_version=sympy.__version__,
    )


def rises(definitions: Mapping[Symbol, Expr], deflection: Deflection) -> bool:
    """Whether F_ela is seen to rise with delta, from the signs of its terms: what rises otherwise is not known to."""
    size = Dummy("delta", positive=True)
    slope = definitions[dF_ddelta]
    radius = Dummy("a", positive=True)
    sides = {"compression": (1,), "tension": (-1,), "either": (1, -1)}[deflection]
    return all(slope.subs(a, radius).subs(delta, side * size).is_positive for side in sides)


def newton_step(
    definitions: Mapping[Symbol, Expr], rising: bool
) -> tuple[list[Assignment], tuple[str, ...], list[Assignment]]:
    """Code of a step of Newton's iteration for delta at a given gap, (F_ela - F)/(dF_ela/d(delta)).

    It is what a kernel spends most of its time on, and divisions and roots are what takes time in it: the quotient is
    written over one denominator if that is cheaper, and all that depends on the gap alone is computed once, before.

    Returns
    -------
    gap_terms : list of Assignment
    terms : tuple of str
        The names of these terms.
    step : list of Assignment
        Of ``newton``, in the terms, delta, F and the parameters; and of ``dF_ddelta``, unless F_ela is known to rise.
    """
    # a keeps its name; what else there is follows from it
    named = {symbol: expr for symbol, expr in definitions.items() if symbol == a}
    slope = definitions[dF_ddelta]
    if not rising:
        quotient = (definitions[F_ela] - F) / dF_ddelta
        return _by_gap_first({**named, dF_ddelta: slope, NEWTON: quotient}, (NEWTON, dF_ddelta))
    quotient = (definitions[F_ela] - F) / slope
    found = [_by_gap_first({**named, NEWTON: form}, (NEWTON,)) for form in (quotient, together(quotient))]
    return min(found, key=lambda parts: _cost(parts[2]))


def _by_gap_first(
    definitions: Mapping[Symbol, Expr], wanted: tuple[Symbol, ...]
) -> tuple[list[Assignment], tuple[str, ...], list[Assignment]]:
    """Split what leads to a step of Newton's iteration into what depends on the gap alone, and the rest."""
    hoisted: dict[Expr, Symbol] = {}
    moving = {delta, F}
    for symbol, expr in definitions.items():
        if expr.free_symbols & moving:
            moving.add(symbol)

    def term(expr: Expr) -> Expr:
        """Stand-in for an expression without delta, if it depends on the gap, which a step does not know."""
        if not expr.has(h):
            return expr
        return hoisted.setdefault(expr, Symbol(f"gap{len(hoisted)}", real=True))

    def visit(expr: Expr) -> Expr:
        if not expr.free_symbols & moving:
            return term(expr)
        if not expr.args:
            return expr
        if isinstance(expr, (Add, Mul)):
            still, rest = expr.as_independent(*moving, as_Add=isinstance(expr, Add))
            parts = rest.args if isinstance(rest, type(expr)) else (rest,)
            return expr.func(term(still), *(visit(part) for part in parts))
        return expr.func(*(visit(part) for part in expr.args))

    rest = {symbol: visit(expr) for symbol, expr in definitions.items()}
    step = straight_line(wanted, rest)
    read = set().union(*(names_in(text) for _, text in step))
    # what leads to a alone falls away where the quotient has none
    terms = {symbol: expr for expr, symbol in hoisted.items() if symbol.name in read}
    names = tuple(symbol.name for symbol in terms)
    return straight_line(tuple(terms), {**definitions, **terms}), names, step


def _cost(lines: list[Assignment]) -> int:
    """Time of straight-line code, roughly, in units of an addition."""
    counts = operations(lines)
    return sum(counts[kind] * COSTS.get(kind, 1) for kind in KINDS)


def _require_known(law: ContactLaw, needs: Needs, outputs: tuple[str, ...], names: list[str]) -> None:
    faults = [
        f"{name!r} cannot be fixed: the parameters are {', '.join(names)}" for name in needs.fixed if name not in names
    ]
    for symbol, allowed in ranges_of(law).items():
        if symbol.name in needs.fixed and Rational(needs.fixed[symbol.name]) not in allowed:
            faults.append(f"{range_text(symbol, allowed)} must hold, and {symbol.name} is {needs.fixed[symbol.name]}")
    for symbol in parameters_of(law):
        if symbol.is_positive and symbol.name in needs.fixed and not float(needs.fixed[symbol.name]) > 0:
            faults.append(f"{symbol.name} must be positive, not {needs.fixed[symbol.name]}")
    sensible = {*names, *((compliance.name,) if needs.control == "spring" else ())} - set(needs.fixed)
    faults += [
        f"there is no slope by {name!r}: it is {'fixed' if name in needs.fixed else 'no parameter of the law'}"
        for name in needs.sensitive
        if name not in sensible
    ]
    known = outputs_of(law) + (() if needs.control == "force" else ("F", "dF_dt"))
    faults += [
        f"{name!r} is no output{' of this law' if name in OUTPUTS else ''}; there are {', '.join(known)}"
        for name in outputs
        if name not in known
    ]
    if faults:
        raise LawError(law.name, tuple(faults))


def _symbol_named(definitions: dict[Symbol, Expr], name: str) -> Symbol:
    return next(symbol for symbol in definitions if output_name(symbol) == name)
