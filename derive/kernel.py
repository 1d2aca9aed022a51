"""The intermediate representation of a kernel: everything that a template sees.

Input: a law and what a scene needs of its kernel. Output: a :class:`KernelIR`, plain text and numbers.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import sympy
from sympy import Add, Dummy, Expr, Mul, Rational, Symbol, together

from softdyn.derive.controls import BY_FORCE, SLOPES, compliance
from softdyn.derive.drive import DriveCode, drive_code
from softdyn.derive.dynamics import F_ela, ddelta_dt, dF_ddelta, dF_dt, dh_dt, dX_dt
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
    pair_equations,
)
from softdyn.derive.printing import KINDS, Assignment, operations, print_expression, straight_line
from softdyn.derive.radau import PANEL_NODES, STAGES
from softdyn.derive.rules import RULES, Rule, Saving, specialised
from softdyn.derive.symbols import F, a, delta, h
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.contact_kernel import ContactIR
    from softdyn.derive.law import ContactLaw

NEWTON = Symbol("newton", real=True)
#: Of a division, a root and a function, over that of an addition.
COSTS = {"div": 8, "sqrt": 8, "call": 20}


@dataclass(frozen=True)
class Code:
    """Straight-line code, and the parameters that it takes from the array ``p``: (name, index)."""

    parameters: tuple[tuple[str, int], ...]
    lines: tuple[Assignment, ...]


@dataclass(frozen=True)
class KernelIR:
    """Everything a template sees.

    Attributes
    ----------
    name : str
        Prefix of the generated functions: the law's name.
    source, law_hash, declaration : str
        Provenance: where the law comes from, its fingerprint, its four expressions.
    parameters : tuple of str
        What the array ``p`` holds, in order; R first unless it is fixed.
    fixed : tuple of (str, str)
        Parameters that are numbers in the text.
    radius : str
        R as text: where Newton's iteration starts if the linear response is larger.
    drive : "constant", "table" or "expression"
    control : "force", "position", "velocity" or "spring"
        What the drive gives.
    drive_text : str
        The expression of what is given, if it is one, with its constants named c0, c1, ...
    constants : int
        How many constants the array ``c`` holds, with the choices between its smooth parts.
    deflection : "either", "compression" or "tension"
    rigid : bool
        Whether the particles do not deform.
    outputs : tuple of str
    output_variables : tuple of str
        Their names in the code.
    inputs : tuple of str
        What the outputs depend on besides h, delta and the parameters: "F", "dF_dt", "dX_dt".
    components : int
        Of the state: ln h, and delta unless the force is given.
    width : int
        Numbers that describe a step: its start, its length, what ends it; of each component its value and its stages.
        Under a constant force there is room for a panel: the nodes' times, and its length in ln h. Last, the estimated
        errors within the step, of ln h at a given time and of the time at a given gap.
    slope_names : tuple of str
        The Jacobian's entries in the code.
    anchored : bool
        Whether F_ela vanishes at delta = 0.
    rising : bool
        Whether F_ela is known to rise with delta at any gap and deflection.
    terms : tuple of str
        What Newton's iteration for delta uses of the gap alone.
    gap_terms, newton, gap_rate, slopes, quantities, force, given : Code
        Of these terms; of a step of Newton's iteration, (F_ela - F)/(dF_ela/d(delta)); of the rates of the state; of
        their Jacobian; of the outputs; of what the drive gives, and its rate.
    savings : tuple of Saving
        What each rule of specialisation saved.
    operations : dict
        Operations of each part of the code, by kind.
    sympy_version : str
    """

    #: Name of its templates.
    template: ClassVar[str] = "kernel"

    name: str
    source: str
    law_hash: str
    declaration: tuple[tuple[str, str], ...]
    parameters: tuple[str, ...]
    fixed: tuple[tuple[str, str], ...]
    radius: str
    drive: str
    control: str
    drive_text: str
    constants: int
    program: tuple[float, ...]
    program_numbers: int
    deflection: str
    rigid: bool
    outputs: tuple[str, ...]
    output_variables: tuple[str, ...]
    inputs: tuple[str, ...]
    components: int
    width: int
    slope_names: tuple[str, ...]
    anchored: bool
    rising: bool
    terms: tuple[str, ...]
    gap_terms: Code
    newton: Code
    gap_rate: Code
    slopes: Code
    quantities: Code
    force: Code
    given: Code
    given_name: str
    savings: tuple[Saving, ...]
    operations: dict[str, dict[str, int]]
    sympy_version: str


def kernel_ir(law: ContactLaw, needs: Needs, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive a law's equations, specialise them to a scene's needs, and lower them to straight-line code.

    With fewer ``rules`` than there are, the kernel computes the same, and more than it needs.

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
    own = replace(needs, fixed={codes[name]: value for name, value in needs.fixed.items()})
    expression = isinstance(needs.drive, tuple)
    equations, savings = specialised(pair_equations(in_code(law), needs.control, expression), own, rules)
    definitions = equations.definitions
    # rigid particles transmit any force, without a deflection
    rigid = is_rigid(law)
    rising = rigid or rises(definitions, needs.deflection)
    gap_terms, terms, newton = ([], (), []) if rigid else newton_step(definitions, rising)
    by_force = needs.control == "force"
    gap_rate = straight_line([dh_dt] if by_force else [dh_dt, ddelta_dt], definitions)
    entries = tuple(symbol for symbol in integrated(needs.control, expression) if symbol in (*SLOPES, BY_FORCE))
    slopes = straight_line(entries, definitions)
    asked = [_symbol_named(definitions, name) for name in outputs]
    quantities = straight_line(asked, definitions)
    # what the integrator needs of the drive is its value, or the rate at which it moves the centres
    only = F if needs.control in ("force", "velocity") else dF_dt
    drive = drive_code(needs.drive, only == F) if isinstance(needs.drive, tuple) else DriveCode()
    force, given = drive.force, drive.given
    parameters = tuple(name for name in names if name not in needs.fixed)
    coded = tuple(codes[name] for name in parameters)
    if needs.control == "spring":
        parameters += (compliance.name,)
        coded += (compliance.name,)

    def code(lines: list[Assignment]) -> Code:
        used = _names_in(lines)
        return Code(tuple((name, i) for i, name in enumerate(coded) if name in used), tuple(lines))

    used = _names_in(quantities)
    return KernelIR(
        name=law.name,
        source=law.source or "no source given",
        law_hash=law_hash(law),
        declaration=tuple((name, str(getattr(law, name))) for name in ("a", "F_ela", "zeta", "F_adh")),
        parameters=parameters,
        fixed=tuple(sorted(needs.fixed.items())),
        radius=print_expression(Rational(needs.fixed["R"])) if "R" in needs.fixed else "p[0]",
        drive="expression" if expression else str(needs.drive),
        control=needs.control,
        drive_text=drive.text,
        constants=drive.constants,
        program=drive.program,
        program_numbers=drive.numbers,
        deflection=needs.deflection,
        rigid=rigid,
        outputs=outputs,
        output_variables=tuple(symbol.name for symbol in asked),
        inputs=tuple(symbol.name for symbol in ((F, dF_dt) if by_force else (dX_dt,)) if symbol.name in used),
        components=1 if by_force else 2,
        width=7 + PANEL_NODES if by_force and needs.drive == "constant" else 5 + (STAGES + 1) * (1 if by_force else 2),
        slope_names=tuple(symbol.name for symbol in entries),
        anchored=is_anchored(law),
        rising=rising,
        terms=terms,
        gap_terms=code(gap_terms),
        newton=code(newton),
        gap_rate=code(gap_rate),
        slopes=code(slopes),
        quantities=code(quantities),
        force=code(force),
        given=code(given),
        given_name=only.name,
        savings=savings,
        operations={
            part: operations(lines)
            for part, lines in (
                ("gap_terms", gap_terms),
                ("newton", newton),
                ("gap_rate", gap_rate),
                ("slopes", slopes),
                ("quantities", quantities),
                ("force", force),
                ("given", given),
            )
        },
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
        """Stand-in for an expression without delta, if it is more than a name and depends on the gap."""
        if not expr.has(h) or not expr.args:
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
    terms = {symbol: expr for expr, symbol in hoisted.items()}
    names = tuple(symbol.name for symbol in terms)
    return straight_line(terms, {**definitions, **terms}), names, straight_line(wanted, rest)


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


def _names_in(lines: list[Assignment]) -> set[str]:
    return {name for _, text in lines for name in re.findall(r"[A-Za-z_]\w*", text)}


def total_operations(ir: KernelIR | ContactIR) -> int:
    """Count all operations of a kernel's law: balance, rate, slopes, outputs and force."""
    return sum(ir.operations[part][kind] for part in ir.operations for kind in KINDS)
