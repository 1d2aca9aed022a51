"""The kernel of many elements of a weak form: residuals and Jacobians, from values at the nodes of a mesh.

Input: a form and what a scene needs of it. Output: a :class:`KernelIR` of the kind ``elements``. Its arrays are ``at``,
the coordinates of a node, ``fields``, the unknowns of a node, ``q``, the coefficients of a node that vary, and ``p``,
numbers: uniform coefficients and parameters. Its one function gives the residuals of an element, node by node, and then
the rows of its matrix. Its settings: ``nodes`` of an element.
"""

from __future__ import annotations

import sympy

from softdyn.derive.element_equations import (
    ElementNeeds,
    coordinate,
    element_equations,
    entry_of,
    residual_of,
    unknowns,
)
from softdyn.derive.kernel_form import KernelIR, Provenance, function
from softdyn.derive.printing import straight_line
from softdyn.derive.rules import RULES, Rule, specialised
from softdyn.derive.weak_form import WeakForm, form_hash, own_symbol
from softdyn.errors import LawError


def element_ir(form: WeakForm, needs: ElementNeeds, rules: tuple[Rule, ...] = RULES) -> KernelIR:
    """Derive the equations of an element, specialise them, and lower them to straight-line code.

    Raises
    ------
    LawError
        If a coefficient that is uniform or absent is not the form's, or is both.
    """
    names = [one.name for one in form.coefficients]
    faults = [
        f"{name!r} is no coefficient; there are {', '.join(names)}"
        for name in (*needs.uniform, *needs.absent)
        if name not in names
    ]
    faults += [f"{name!r} is both uniform and absent" for name in needs.uniform if name in needs.absent]
    if faults:
        raise LawError(form.name, tuple(faults), "weak form")
    equations, savings = specialised(element_equations(form), needs, rules)
    nodes = range(form.dimension + 1)
    left = {symbol for expr in equations.definitions.values() for symbol in expr.free_symbols}
    varying = [one for one in form.coefficients if any(s in left for node in nodes for s in one.nodal(node))]
    uniform = [symbol for one in form.coefficients for symbol in one.values if symbol in left]
    code = {
        "at": [coordinate(node, axis).name for node in nodes for axis in range(form.dimension)],
        "fields": [symbol.name for symbol in unknowns(form)],
        "q": [symbol.name for node in nodes for one in varying for symbol in one.nodal(node)],
        "p": [symbol.name for symbol in (*uniform, *map(own_symbol, form.parameters))],
    }
    count = len(unknowns(form))
    targets = [residual_of(i) for i in range(count)] + [entry_of(i, j) for i in range(count) for j in range(count)]
    lines = straight_line(targets, equations.definitions)
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
            "at": tuple("xyz"[: form.dimension]),
            "fields": _plain(name for one in form.fields for name in one.components),
            "q": _plain(name for one in varying for name in one.components),
            "p": _plain(code["p"]),
        },
        functions={"element": function(lines, [symbol.name for symbol in targets], (), code)},
        settings={"nodes": form.dimension + 1},
        savings=savings,
    )


def _plain(names: object) -> tuple[str, ...]:
    """Names as they were declared."""
    return tuple(str(name).removeprefix("own_") for name in names)  # type: ignore[attr-defined]
