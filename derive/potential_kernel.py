"""The kernel of a potential: energy, force and its slope of many pairs, and the activation of each.

Input: a potential. Output: a :class:`KernelIR` of the kind ``potentials``. Its functions are ``pair``, which gives U, F
and F_r of one pair, nan outside of the potential's domain, and ``activity``, without code where there is no activation.
"""

from __future__ import annotations

import re

import sympy
from sympy import And, Dummy, Expr, Piecewise, S, Symbol, diff, exp, log, oo, simplify
from sympy.codegen.cfunctions import expm1, log1p

from softdyn.derive.elementary import for_lanes
from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function
from softdyn.derive.potential import (
    F,
    F_r,
    Potential,
    U,
    age,
    contact,
    distance_from,
    force_of,
    is_active,
    potential_hash,
    r,
    shear_rate,
)
from softdyn.derive.printing import straight_line
from softdyn.derive.soundness import sound

activity, activity_age = Symbol("activity", real=True), Symbol("activity_age", real=True)


def sound_forms(potential: Potential) -> dict[Symbol, Expr]:
    """Definitions of U, F and F_r, in differences of the distance and a length, each by itself.

    r - d is exact to a rounding where it is small; no form that multiplies it out is. ``log(1 - x)`` becomes ``log1p``.

    Raises
    ------
    AssertionError
        If a form is not what was derived.
    """
    differences: dict[Expr, Symbol] = {}

    def difference(node: Expr) -> Expr:
        slope, rest = node.diff(r), distance_from(node)
        return slope * differences.setdefault(r - rest, Dummy(f"apart{len(differences)}", real=True))

    forms = {}
    for symbol, expr in force_of(potential).items():
        apart = expr.replace(lambda node: node.is_Add and distance_from(node) is not None, difference)
        near_one = apart.replace(_is_log_near_one, lambda node: log1p(node.args[0] - 1))
        forms[symbol] = near_one if near_one != apart else sound(apart)
        plain = forms[symbol].replace(log1p, lambda x: log(1 + x)).replace(expm1, lambda x: exp(x) - 1)
        assert simplify(plain - apart) == 0, f"{symbol} of {potential.name} is not what was derived"
    named = {gap: Symbol(f"apart{k}", real=True) for k, gap in enumerate(differences.values())}
    definitions = {named[gap]: written for written, gap in differences.items()}
    return {**definitions, **{symbol: expr.xreplace(named) for symbol, expr in forms.items()}}


def _is_log_near_one(node: Expr) -> bool:
    return isinstance(node, log) and node.args[0].is_Add and S.One in node.args[0].args


def code_names(potential: Potential) -> dict[Symbol, Symbol]:
    """Parameters as generated code names them: own_NAME, so that none is that of anything else there."""
    names: dict[Symbol, Symbol] = {}
    for symbol in potential.parameters:
        name = "own_" + re.sub(r"[^A-Za-z0-9_]", "_", symbol.name)
        # own_x_p2 would be the square of own_x
        while re.search(r"_p\d+$", name) or name in {one.name for one in names.values()}:
            name += "_"
        names[symbol] = Symbol(name, **symbol.assumptions0)
    return names


def potential_ir(potential: Potential) -> KernelIR:
    """Derive the kernel of a potential, and lower it to straight-line code."""
    names = code_names(potential)
    low, high = (S(end).xreplace(names) for end in potential.domain)
    inside = [*([r > low] if low != 0 else []), *([r < high] if high != oo else [])]

    def bounded(expr: Expr) -> Expr:
        return Piecewise((expr, And(*inside))) if inside else expr

    forms = {symbol: expr.xreplace(names) for symbol, expr in sound_forms(potential).items()}
    pair = {symbol: bounded(expr) if symbol in (U, F, F_r) else expr for symbol, expr in forms.items()}
    active = {
        activity: sound(potential.activation).xreplace(names),
        activity_age: sound(diff(potential.activation, age)).xreplace(names),
    }
    arrays = {"p": [names[symbol].name for symbol in potential.parameters]}

    def code(targets: tuple[Symbol, ...], definitions: dict[Symbol, Expr], given: tuple[Symbol, ...]) -> Function:
        lines = [(name, for_lanes(text)) for name, text in straight_line(targets, definitions)]
        return function(lines, [symbol.name for symbol in targets], [symbol.name for symbol in given], arrays)

    return KernelIR(
        kind="potentials",
        name=potential.name,
        provenance=Provenance(
            title=f"Potential {potential.name}:",
            source=potential.source or "no source given",
            declared="potential",
            fingerprint=potential_hash(potential),
            declaration=(("energy", str(potential.energy)), ("activation", str(potential.activation))),
            sympy_version=sympy.__version__,
        ),
        arrays={"p": tuple(symbol.name for symbol in potential.parameters)},
        functions={
            "pair": code((U, F, F_r), pair, (r, contact)),
            "activity": code(() if is_active(potential) else (activity, activity_age), active, (age, shear_rate)),
        },
        settings={},
        savings=(),
    )
