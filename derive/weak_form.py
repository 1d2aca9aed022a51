"""Declaring a weak form: unknown fields, known ones, and what is integrated over elements, or over facets.

A form is a sum of terms, each linear in the test functions, that vanishes for all of them::

    integral of terms(test functions, fields, coefficients, parameters)  =  0

Fields are continuous, and linear or quadratic on each triangle or tetrahedron. A term is written in the values and the
gradients of fields at a point, as symbols of sympy or matrices of these. A quantity names what terms have in common, in
terms of the same: any function, as integrals are sums over points of quadrature.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from hashlib import sha256
from typing import Any

from sympy import Expr, Matrix, S, Symbol, srepr

from softdyn.derive.dimensions import DIMENSIONLESS, LENGTH, Dimension, DimensionMismatchError, dimension_of
from softdyn.errors import LawError

#: What fields and quantities may be called, and parameters, which closures declare.
NAME, PARAMETER = re.compile(r"[A-Za-z][A-Za-z0-9]*"), re.compile(r"[A-Za-z]\w*", re.ASCII)
#: Endings and middles of names in code that are derivatives, powers, and coordinates of something else.
OF_CODE = re.compile(r"_[dpn]\d+$|_by_|_lane$")
#: Sum of the squares of the gradients of an element's linear shape functions: 4/h^2 of an equilateral triangle.
FINENESS = Symbol("fineness", positive=True)


def metric(d: int) -> Any:
    """Sum over an element's linear shape functions of the products of their derivatives: a matrix of d rows."""
    return Matrix(d, d, lambda m, n: Symbol(f"metric{min(m, n)}{max(m, n)}", real=True))


def normal(d: int) -> Any:
    """Outward normal of a facet: a matrix of one column."""
    return Matrix([Symbol(f"normal{m}", real=True) for m in range(d)])


@dataclass(frozen=True)
class Field:
    """A scalar or a vector field.

    Attributes
    ----------
    name : str
    dimension : 2 or 3
        Of space.
    vector : bool
    order : 1 or 2
        Of the polynomials that it consists of on each element.
    """

    name: str
    dimension: int
    vector: bool = False
    order: int = 1

    @property
    def components(self) -> tuple[str, ...]:
        """Names of its components in code."""
        return tuple(f"own_{self.name}{k}" for k in range(self.dimension)) if self.vector else (f"own_{self.name}",)

    @property
    def values(self) -> tuple[Symbol, ...]:
        """Its components at a point."""
        return tuple(Symbol(name, real=True) for name in self.components)

    @property
    def value(self) -> Any:
        """Its value at a point: a symbol, or a matrix of one column."""
        return Matrix(self.values) if self.vector else self.values[0]

    @property
    def gradients(self) -> tuple[tuple[Symbol, ...], ...]:
        """Derivatives of each component along each axis."""
        axes = range(self.dimension)
        return tuple(tuple(Symbol(f"{name}_d{m}", real=True) for m in axes) for name in self.components)

    @property
    def gradient(self) -> Any:
        """A matrix of one column; of a vector field, of a row for each component."""
        return Matrix(self.gradients) if self.vector else Matrix(self.gradients[0])

    @property
    def slots(self) -> tuple[tuple[Symbol, ...], ...]:
        """Of each component its value, then its derivatives."""
        return tuple((value, *row) for value, row in zip(self.values, self.gradients, strict=True))

    @property
    def test(self) -> Field:
        """Its test function."""
        return Field(f"{self.name}_test", self.dimension, self.vector, self.order)


def dot(one: Any, other: Any) -> Expr:
    """Product of two matrices, entry by entry, summed."""
    return sum((x * y for x, y in zip(one, other, strict=True)), start=S.Zero)


def symmetric(gradient: Any) -> Any:
    """Symmetric part of the gradient of a vector field, D(u)."""
    return (gradient + gradient.T) / 2


def divergence(vector: Field) -> Expr:
    """Divergence of a vector field."""
    return vector.gradient.trace()


@dataclass(frozen=True, eq=False)
class WeakForm:
    """A weak form on triangles or tetrahedra, or on their facets.

    Parameters
    ----------
    name : str
    dimension : 2 or 3
    fields : tuple of Field
        Unknown.
    coefficients : tuple of Field
        Known: given at the nodes, or where a scene says so uniform, one everywhere, or absent.
    terms : mapping from str to Expr
        What is integrated, by name.
    parameters : tuple of Symbol
        Numbers.
    quantities : mapping from Symbol to Expr
        Each in terms of earlier ones, of values and gradients of fields and coefficients, of parameters,
        :data:`FINENESS` and :func:`metric`; of facets also of :func:`normal`.
    without : mapping from str to mapping from Symbol to Expr
        What quantities are in the limit where a coefficient or a parameter is absent, if putting zero in its place
        does not give it.
    degree : int, optional
        Of the polynomials that quadrature integrates exactly, where terms are no polynomials. Those that are, are
        integrated exactly whatever their degree.
    on_facets : bool
        Whether it is integrated over facets.
    units : mapping from str to Dimension
        Of every field, coefficient and parameter, by name. Terms are checked if it is given: those of one test
        function must have one dimension. A quantity's is found, unless it is given, too.
    source : str

    Raises
    ------
    LawError
        Naming every fault.
    """

    name: str
    dimension: int
    fields: tuple[Field, ...]
    coefficients: tuple[Field, ...]
    terms: Mapping[str, Expr]
    parameters: tuple[Symbol, ...] = ()
    quantities: Mapping[Symbol, Expr] = field(default_factory=dict)
    without: Mapping[str, Mapping[Symbol, Expr]] = field(default_factory=dict)
    degree: int | None = None
    on_facets: bool = False
    units: Mapping[str, Dimension] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        faults = _faults(self)
        if not faults and self.units:
            faults = _unit_faults(self)
        if faults:
            raise LawError(self.name, tuple(faults), "weak form")


def _faults(form: WeakForm) -> list[str]:
    fields = (*form.fields, *form.coefficients)
    faults = [f"field {one.name} is of {one.dimension} dimensions" for one in fields if one.dimension != form.dimension]
    faults += [
        f"field {one.name} is of order {one.order}; it can be 1 or 2" for one in fields if one.order not in (1, 2)
    ]
    own = [*form.parameters, *form.quantities]
    names = [one.name for one in (*fields, *form.quantities)]
    # own_NAME is what it is called in code
    faults += [f"the name {name!r} is not of letters and digits" for name in names if not NAME.fullmatch(name)]
    numbers = [symbol.name for symbol in form.parameters]
    faults += [
        f"the name {name!r} is not of letters, digits and _" for name in numbers if not PARAMETER.fullmatch(name)
    ]
    faults += [f"the name {name!r} is taken by the code" for name in numbers if OF_CODE.search(name)]
    taken = [name.removeprefix("own_") for one in fields for name in one.components] + [symbol.name for symbol in own]
    faults += [f"two things are named {name}" for name in sorted({name for name in taken if taken.count(name) > 1})]
    faults += [] if form.name.isidentifier() else [f"the form's name {form.name!r} is no identifier"]
    known = {FINENESS, *metric(form.dimension), *form.parameters}
    known |= set(normal(form.dimension)) if form.on_facets else set()
    known |= {s for one in fields for slots in one.slots for s in slots}
    for symbol, expr in form.quantities.items():
        faults += _unknown(f"quantity {symbol}", expr, known)
        known.add(symbol)
    can_be_absent = {one.name for one in (*form.coefficients, *form.parameters)}
    for name, limits in form.without.items():
        if name not in can_be_absent:
            faults.append(f"without: {name!r} is no coefficient and no parameter")
        for symbol, expr in limits.items():
            where = f"{symbol} without {name}"
            faults += _unknown(where, expr, known) if symbol in form.quantities else [f"{where}: it is no quantity"]
    tests = of_tests(form)
    for name, term in form.terms.items():
        faults += _unknown(f"term {name!r}", term, known | set(tests))
        slopes = [term.diff(symbol) for symbol in tests]
        if term.subs(dict.fromkeys(tests, 0)) != 0 or any(slope.free_symbols & set(tests) for slope in slopes):
            faults.append(f"term {name!r} is not linear in the test functions")
    return faults


def _unknown(what: str, expr: Expr, known: set[Symbol]) -> list[str]:
    faults = []
    names = {symbol.name.removeprefix("own_") for symbol in known}
    for symbol in sorted(expr.free_symbols - known, key=str):
        shown = symbol.name.removeprefix("own_")
        near = get_close_matches(shown, names, 1)
        faults.append(f"{what} has {shown}, which is declared nowhere" + (f"; is {near[0]} meant?" if near else ""))
    return faults


def _unit_faults(form: WeakForm) -> list[str]:
    """Quantities and terms whose dimension is none, or not that of other terms of the same test function."""
    fields, d = (*form.fields, *form.coefficients), form.dimension
    missing = [one.name for one in (*fields, *form.parameters) if one.name not in form.units]
    if missing:
        return [f"units: the dimension of {name} is missing" for name in missing]
    known: dict[Symbol, Dimension] = {FINENESS: LENGTH**-2, **dict.fromkeys(metric(d), LENGTH**-2)}
    known |= dict.fromkeys(normal(d), DIMENSIONLESS)
    known |= {symbol: form.units[symbol.name] for symbol in form.parameters}
    for one in fields:
        for value, *slopes in one.slots:
            known |= {value: form.units[one.name], **dict.fromkeys(slopes, form.units[one.name] / LENGTH)}
    faults: list[str] = []
    for symbol, expr in form.quantities.items():
        try:
            known[symbol] = form.units.get(symbol.name) or dimension_of(expr, known) or DIMENSIONLESS
        except DimensionMismatchError as error:
            return [*faults, f"quantity {symbol}: {error}"]
    for one in form.fields:
        first: tuple[str, Dimension] | None = None
        for name, term in form.terms.items():
            for k, symbol in ((k, s) for slots in one.test.slots for k, s in enumerate(slots)):
                try:
                    unit = dimension_of(term.diff(symbol), known)
                except DimensionMismatchError as error:
                    faults.append(f"term {name!r}: {error}")
                    break
                if unit is None:
                    continue
                whole = unit / LENGTH if k else unit
                first = first or (name, whole)
                if whole != first[1]:
                    faults.append(
                        f"term {name!r} is a {whole} for the test function of {one.name}, and {first[0]!r} a {first[1]}"
                    )
                    break
    return faults


def of_tests(form: WeakForm) -> list[Symbol]:
    """Values and gradients of the test functions."""
    return [s for one in form.fields for slots in one.test.slots for s in slots]


def in_code(form: WeakForm, expr: Expr) -> Expr:
    """An expression with the form's own parameters and quantities named as in generated code."""
    return expr.xreplace({s: own_symbol(s) for s in (*form.parameters, *form.quantities)})


def own_symbol(symbol: Symbol) -> Symbol:
    """A parameter or a quantity of a form as it is named in generated code."""
    return Symbol(f"own_{symbol.name}", **symbol.assumptions0)


def form_hash(form: WeakForm) -> str:
    """Fingerprint of what a form declares."""
    parts = [form.dimension, form.fields, form.coefficients, form.parameters, form.degree, form.on_facets]
    texts = [*map(repr, parts), *(f"{name} {srepr(expr)}" for name, expr in form.terms.items())]
    texts += [f"{symbol} {srepr(expr)}" for symbol, expr in form.quantities.items()]
    texts += [f"{name} {symbol} {srepr(x)}" for name, some in form.without.items() for symbol, x in some.items()]
    return sha256("\n".join(texts).encode()).hexdigest()[:12]
