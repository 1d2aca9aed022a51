"""The kernel of many elements of a weak form: residual and Jacobian of all unknowns, from values at nodes.

Input: a form and what a scene needs of it. Output: a :class:`KernelIR` of the kind ``elements``. Its arrays are ``at``,
coordinates of the corners of an element, ``fields``, unknown components, each with its value and its derivatives at a
point, ``q``, components of the coefficients that vary, likewise, and ``p``, numbers: uniform coefficients and
parameters. Its functions give the geometry of an element and of a facet, and at a point the fluxes, without and with
their slopes. Settings:

- ``dimension``, ``on_facets``; ``nodes``: orders of fields, each with the number of nodes of an element;
- ``unknowns``, ``varying``: the order of each component of ``fields`` and of ``q``;
- ``fluxes``: (component, slot) of those that are not zero; ``blocks``: (test component, unknown component, (slot, slot)
  of each slope that is not zero); ``pairs``: of orders that blocks couple;
- ``weights`` of the points of quadrature, and for each order ``values`` of the shape functions there, and their
  ``slopes`` by barycentric coordinates; of a form on facets for one facet after another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy
from sympy import Expr, Symbol

from softdyn.derive.element_equations import (
    ElementNeeds,
    coordinate,
    degree_of,
    determinant,
    element_equations,
    entry_of,
    facet_geometry,
    flux_of,
    geometry,
    measure,
    opposite,
    slope,
    slots_of,
)
from softdyn.derive.elementary import for_lanes, without_powers
from softdyn.derive.equations import Equations
from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function
from softdyn.derive.printing import straight_line
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.derive.simplices import node_count, rule, slopes_at, values_at
from softdyn.derive.weak_form import FINENESS, Field, WeakForm, form_hash, metric, normal, own_symbol
from softdyn.errors import LawError


def needs_faults(form: WeakForm, needs: ElementNeeds) -> list[str]:
    """What is asked of a form that it cannot give."""
    coefficients = [one.name for one in form.coefficients]
    numbers = [symbol.name for symbol in form.parameters]
    known = {"uniform": coefficients, "unit": coefficients, "absent": [*coefficients, *numbers]}
    faults = []
    for what, names in known.items():
        kind = "coefficient or parameter" if what == "absent" else "coefficient"
        faults += [
            f"{what}: {name!r} is no {kind}; there are {', '.join(names) or 'none'}"
            for name in getattr(needs, what)
            if name not in names
        ]
    asked = [*needs.uniform, *needs.absent, *needs.unit]
    return faults + [
        f"{name!r} is more than one of uniform, absent and one"
        for name in sorted({x for x in asked if asked.count(x) > 1})
    ]


def element_ir(form: WeakForm, needs: ElementNeeds, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive the equations at a point of an element, specialise them, and lower them to straight-line code.

    Parameters
    ----------
    form : WeakForm
    needs : ElementNeeds
    rules : tuple of Rule

    Raises
    ------
    LawError
        If what is uniform, absent or one is not the form's, or is two of these; if nothing is left.
    """
    faults = needs_faults(form, needs)
    if faults:
        raise LawError(form.name, tuple(faults), "weak form")
    equations, savings = specialised(element_equations(form), needs, rules)
    d, definitions = form.dimension, equations.definitions
    count = len(slots_of(form.fields))
    places = [(i, s) for i in range(count) for s in range(d + 1)]
    fluxes = [place for place in places if definitions[flux_of(*place)] != 0]
    slopes = [(*one, *two) for one in places for two in places if definitions[entry_of(*one, *two)] != 0]
    if not fluxes:
        raise LawError(form.name, ("nothing is left of it",), "weak form")
    kept = [flux_of(*place) for place in fluxes]
    whole = [*kept, *(entry_of(*place) for place in slopes)]
    left = _used(whole, equations)
    # one number stands for all nodes where no gradient is left, as the rule for what is uniform sees to
    sloping = {one.name for one in form.coefficients if left & {s for row in one.gradients for s in row}}
    constant = [one for one in form.coefficients if one.name in needs.uniform and one.name not in sloping]
    varying = [one for one in form.coefficients if one not in constant and left & {s for row in one.slots for s in row}]
    uniform = [s for one in constant for s in one.values if s in left]
    numbers = [*uniform, *(own_symbol(symbol) for symbol in form.parameters if own_symbol(symbol) in left)]
    arrays = {
        "fields": [s.name for slots in slots_of(form.fields) for s in slots],
        "q": [s.name for slots in slots_of(tuple(varying)) for s in slots],
        "p": [s.name for s in numbers],
    }
    own = [FINENESS, *dict.fromkeys(metric(d)), *normal(d)]
    at = {"at": [coordinate(node, axis).name for node in range(d + 1) for axis in range(d)]}
    wanted = [symbol for symbol in own[:-d] if symbol in left] + ([] if form.on_facets else [measure])
    wanted = [*(slope(node, axis) for node in range(d + 1) for axis in range(d)), determinant, *wanted]
    functions = {
        "geometry": _function(wanted, geometry(d), (), at),
        "flux": _function(kept, definitions, own, arrays),
        "point": _function(whole, definitions, own, arrays),
    }
    if form.on_facets:
        ends = [measure, *(symbol for symbol in normal(d) if symbol in left)]
        functions["facet"] = _function(ends, facet_geometry(d), (determinant, *map(opposite, range(d))), {})
    blocks = [
        (i, j, tuple((s, t) for i2, s, j2, t in slopes if (i2, j2) == (i, j)))
        for i, j in dict.fromkeys((i, j) for i, _, j, _ in slopes)
    ]
    unknown_orders, varying_orders = (
        tuple(one.order for one in some for _ in one.components) for some in (form.fields, varying)
    )
    orders = tuple(sorted({*unknown_orders, *varying_orders}))
    weights, points = _points(form, degree_of(form, needs))
    shown = {**form.terms, **{symbol.name: expr for symbol, expr in form.quantities.items()}}
    return KernelIR(
        kind="elements",
        name=form.name,
        provenance=Provenance(
            title=f"Weak form {form.name}:",
            source=form.source or "no source given",
            declared="form",
            fingerprint=form_hash(form),
            declaration=tuple((name, str(expr)) for name, expr in shown.items()),
            sympy_version=sympy.__version__,
        ),
        arrays={
            "at": tuple("xyz"[:d]),
            "fields": _plain(name for one in form.fields for name in one.components),
            "q": _plain(name for one in varying for name in one.components),
            "p": _plain(arrays["p"]),
        },
        functions=functions,
        settings={
            "dimension": d,
            "on_facets": form.on_facets,
            "nodes": tuple((order, node_count(d, order)) for order in orders),
            "unknowns": unknown_orders,
            "varying": varying_orders,
            "fluxes": tuple(fluxes),
            "blocks": tuple(blocks),
            "pairs": tuple(dict.fromkeys((unknown_orders[i], unknown_orders[j]) for i, j, _ in blocks)),
            "weights": weights,
            "values": tuple(values_at(d, order, points) for order in orders),
            "slopes": tuple(slopes_at(d, order, points) for order in orders),
        },
        savings=savings,
    )


def left_fields(form: WeakForm, ir: KernelIR) -> tuple[Field, ...]:
    """Coefficients that a kernel reads at nodes."""
    return tuple(one for one in form.coefficients if _plain(one.components)[0] in ir.arrays["q"])


def _used(symbols: list[Symbol], equations: Equations) -> set[Symbol]:
    """Everything that some symbols are computed from."""
    found = set(symbols)
    for symbol in reversed(equations.definitions):
        if symbol in found:
            found |= equations.definitions[symbol].free_symbols
    return found


def _function(
    wanted: Sequence[Symbol], definitions: dict[Symbol, Expr], given: Iterable[Symbol], arrays: dict[str, list[str]]
) -> Function:
    lines = [(name, for_lanes(without_powers(text))) for name, text in straight_line(wanted, definitions)]
    return function(lines, [symbol.name for symbol in wanted], [symbol.name for symbol in given], arrays)


def _points(form: WeakForm, degree: int) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Weights, and places in an element; of facets those on the one opposite to each corner, one after another."""
    d = form.dimension
    if not form.on_facets:
        return rule(d, degree)
    weights, points = rule(d - 1, degree)
    return weights, tuple((*point[:side], 0.0, *point[side:]) for side in range(d + 1) for point in points)


def _plain(names: object) -> tuple[str, ...]:
    """Names as they were declared."""
    return tuple(str(name).removeprefix("own_") for name in names)  # type: ignore[attr-defined]
