"""The equations of a weak form at a point of an element: what each test function is multiplied by, and its derivatives.

Input: a :class:`WeakForm`. Output: fluxes and their slopes, in the values and gradients of fields and coefficients.

A term is linear in the test functions. Its derivatives by the value and the gradient of a test function are fluxes: the
residual of a node is the integral of the fluxes times the value and the gradient of the node's shape function. The
Jacobian takes no more than the derivatives of the fluxes by the values and gradients of the unknown fields, as these
are linear in the values at nodes. It is that of the sum over the points of quadrature, exact whatever the terms are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import factorial

from sympy import Expr, Matrix, Pow, S, Symbol, diff, sqrt

from softdyn.derive.equations import Equations
from softdyn.derive.weak_form import FINENESS, Field, WeakForm, in_code, metric, normal, of_tests, own_symbol
from softdyn.errors import LawError

#: Determinant of an element's edges: d! its measure, and positive if it is not inverted.
determinant = Symbol("determinant", real=True)
#: Measure of an element, or of a facet.
measure = Symbol("measure", real=True)


@dataclass(frozen=True)
class ElementNeeds:
    """What a scene needs of the kernel of its elements.

    Parameters
    ----------
    uniform : tuple of str
        Coefficients that are the same at all nodes.
    absent : tuple of str
        Coefficients and parameters that are zero.
    unit : tuple of str
        Coefficients that are one.
    """

    uniform: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    unit: tuple[str, ...] = ()


@dataclass(frozen=True)
class ElementEquations(Equations):
    """Equations at a point of an element.

    ``absent``, ``uniform`` and ``unit`` are, by name, what is known where a coefficient or a parameter is zero, where
    a coefficient is the same at all nodes, and where it is one.
    """

    absent: dict[str, dict[Symbol, Expr]] = field(default_factory=dict)
    uniform: dict[str, dict[Symbol, Expr]] = field(default_factory=dict)
    unit: dict[str, dict[Symbol, Expr]] = field(default_factory=dict)


def coordinate(node: int, axis: int) -> Symbol:
    """Coordinate of a corner."""
    return Symbol(f"at{axis}_n{node}", real=True)


def slope(node: int, axis: int) -> Symbol:
    """Derivative of a corner's linear shape function, which is its barycentric coordinate."""
    return Symbol(f"slope{axis}_n{node}", real=True)


def opposite(axis: int) -> Symbol:
    """Derivative of that of the corner which is opposite to a facet."""
    return Symbol(f"opposite{axis}", real=True)


def slots_of(fields: tuple[Field, ...]) -> list[tuple[Symbol, ...]]:
    """Of each component of each field its value, then its derivatives."""
    return [slots for one in fields for slots in one.slots]


def flux_of(i: int, s: int) -> Symbol:
    """What the value (s = 0) or a derivative of test component i is multiplied by."""
    return Symbol(f"flux{i}_{s}", real=True)


def entry_of(i: int, s: int, j: int, t: int) -> Symbol:
    """Derivative of that flux by the value or a derivative of unknown component j.

    Parameters
    ----------
    i, s : int
        Component, and value or derivative, of the flux.
    j, t : int
        Component, and value or derivative, of the unknown.
    """
    return Symbol(f"slope{i}_{s}_by{j}_{t}", real=True)


def geometry(d: int) -> dict[Symbol, Expr]:
    """Edges, determinant, measure, and the slopes of the linear shape functions of a simplex."""
    edges = Matrix(d, d, lambda m, i: Symbol(f"edge{m}_n{i + 1}", real=True))
    found = {edges[m, i]: coordinate(i + 1, m) - coordinate(0, m) for i in range(d) for m in range(d)}
    # lambda_i of the corners but the first are the coordinates along the edges
    cofactors = edges.adjugate()
    named = {(i, m): Symbol(f"cofactor{m}_n{i + 1}", real=True) for i in range(d) for m in range(d)}
    found |= {symbol: cofactors[place] for place, symbol in named.items()}
    inverse = Symbol("inverse", real=True)
    found[determinant] = sum((edges[m, 0] * named[0, m] for m in range(d)), start=S.Zero)
    found |= {measure: determinant / factorial(d), inverse: 1 / determinant}
    found |= {slope(i + 1, m): symbol * inverse for (i, m), symbol in named.items()}
    found |= {slope(0, m): -sum((slope(i + 1, m) for i in range(d)), start=S.Zero) for m in range(d)}
    for m in range(d):
        for n in range(m, d):
            found[metric(d)[m, n]] = sum((slope(i, m) * slope(i, n) for i in range(d + 1)), start=S.Zero)
    found[FINENESS] = metric(d).trace()
    return found


def facet_geometry(d: int) -> dict[Symbol, Expr]:
    """Measure and outward normal of a facet: the barycentric coordinate of the opposite corner falls along it."""
    length = Symbol("steepness", real=True)
    found: dict[Symbol, Expr] = {length: sqrt(sum((opposite(m) ** 2 for m in range(d)), start=S.Zero))}
    found[measure] = determinant * length / factorial(d - 1)
    return found | {normal(d)[m]: -opposite(m) / length for m in range(d)}


@lru_cache(maxsize=8)
def element_equations(form: WeakForm) -> ElementEquations:
    """Everything there is to say about a point, before any specialisation."""
    definitions = {own_symbol(symbol): in_code(form, expr) for symbol, expr in form.quantities.items()}
    terms = [in_code(form, term) for term in form.terms.values()]
    tested, sought = slots_of(tuple(one.test for one in form.fields)), slots_of(form.fields)
    fluxes = {
        flux_of(i, s): sum((diff(term, symbol) for term in terms), start=S.Zero)
        for i, slots in enumerate(tested)
        for s, symbol in enumerate(slots)
    }
    along = _Derivatives(definitions)
    entries = {
        entry_of(i, s, j, t): along.of(fluxes[flux_of(i, s)], symbol)
        for i, slots in enumerate(tested)
        for s in range(len(slots))
        for j, others in enumerate(sought)
        for t, symbol in enumerate(others)
    }
    definitions = definitions | fluxes | along.definitions | entries
    known = [_where(form, one) for one in form.coefficients]
    names = [one.name for one in form.coefficients]
    absent, uniform, unit = (
        (dict(zip(names, some, strict=True)) for some in zip(*known, strict=True)) if known else ({},) * 3
    )
    absent = {**absent, **{symbol.name: {own_symbol(symbol): S.Zero} for symbol in form.parameters}}
    for name, limits in form.without.items():
        absent[name] |= {own_symbol(symbol): in_code(form, expr) for symbol, expr in limits.items()}
    return ElementEquations(definitions, frozenset({*fluxes, *entries}), absent, uniform, unit)


def _where(form: WeakForm, one: Field) -> tuple[dict[Symbol, Expr], dict[Symbol, Expr], dict[Symbol, Expr]]:
    """What is known of a coefficient where it is zero, uniform, one."""
    uniform: dict[Symbol, Expr] = {s: S.Zero for row in one.gradients for s in row}
    absent, unit = ({**dict.fromkeys(one.values, value), **uniform} for value in (S.Zero, S.One))
    return absent, uniform, unit


class _Derivatives:
    """Derivatives along definitions, those of a definition named once."""

    def __init__(self, definitions: dict[Symbol, Expr]) -> None:
        self.given = definitions
        self.known: dict[tuple[Symbol, Symbol], Expr] = {}
        self.definitions: dict[Symbol, Expr] = {}

    def of(self, expr: Expr, variable: Symbol) -> Expr:
        """Total derivative of an expression."""
        inner = sorted(expr.free_symbols & self.given.keys(), key=str)
        return diff(expr, variable) + sum((diff(expr, s) * self._by(s, variable) for s in inner), start=S.Zero)

    def _by(self, symbol: Symbol, variable: Symbol) -> Expr:
        if (symbol, variable) not in self.known:
            found = self.of(self.given[symbol], variable)
            if found.args:
                name = Symbol(f"{symbol.name}_by_{variable.name}", real=True)
                self.definitions[name] = found
                found = name
            self.known[symbol, variable] = found
        return self.known[symbol, variable]


def degree_of(form: WeakForm, needs: ElementNeeds) -> int:
    """Degree to which a form is to be integrated: that of its polynomials, and for what is none the one that it states.

    Raises
    ------
    LawError
        If terms are no polynomials, and the form states no degree.
    """
    equations = element_equations(form)
    known = {s: x for name in needs.absent for s, x in equations.absent[name].items()}
    known |= {s: x for name in needs.unit for s, x in equations.unit[name].items()}
    degrees: dict[Symbol, int | None] = {}
    for one in (*form.fields, *form.coefficients):
        for slots in one.slots:
            for k, symbol in enumerate(slots):
                degrees[symbol] = 0 if one.name in needs.uniform else max(one.order - min(k, 1), 0)
    for symbol, expr in form.quantities.items():
        own = own_symbol(symbol)
        degrees[own] = _degree(known.get(own, in_code(form, expr)).xreplace(known), degrees)
    found = 0
    tests = {
        s: max(one.order - min(k, 1), 0) for one in form.fields for slots in one.test.slots for k, s in enumerate(slots)
    }
    for name, term in form.terms.items():
        for symbol in of_tests(form):
            slope_of = in_code(form, diff(term, symbol)).xreplace(known)
            own_degree = _degree(slope_of, degrees)
            if own_degree is None and form.degree is None:
                fault = f"term {name!r} is no polynomial in the values of fields: the form must state a degree"
                raise LawError(form.name, (fault,), "weak form")
            if slope_of != 0:
                total = form.degree if own_degree is None else own_degree + tests[symbol]
                found = max(found, total or 0)
    return found


def _degree(expr: Expr, degrees: dict[Symbol, int | None]) -> int | None:
    """Degree of an expression as a polynomial in the place; None if it is none."""
    if not expr.free_symbols & degrees.keys():
        return 0
    if expr.is_Symbol:
        return degrees[expr]
    parts = [_degree(part, degrees) for part in expr.args]
    if all(part == 0 for part in parts):
        return 0
    if any(part is None for part in parts):
        return None
    known = [part for part in parts if part is not None]
    if expr.is_Add:
        return max(known)
    if expr.is_Mul:
        return sum(known)
    if isinstance(expr, Pow) and expr.exp.is_Integer and expr.exp > 0:
        return known[0] * int(expr.exp)
    return None
