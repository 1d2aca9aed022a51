"""Declaring a weak form: unknown fields, known ones, and what is integrated over each element.

A form is a sum of terms, each linear in the test functions, that vanishes for all of them::

    sum over elements of  integral of terms(test functions, fields, coefficients, parameters)  =  0

All fields are continuous and linear on each triangle or tetrahedron (P1). A term is written in the value and the
gradient of fields, as symbols of sympy or matrices of these; what is constant on an element, such as the time scale of
a stabilisation, is a quantity, in the means of fields, their gradients and :data:`FINENESS`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from hashlib import sha256
from typing import Any

from sympy import Expr, Matrix, S, Symbol, srepr

from softdyn.errors import LawError

#: What fields, parameters and quantities may be called.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*")
#: Sum of the squares of the gradients of an element's shape functions: 4/h^2 of an equilateral triangle of side h.
FINENESS = Symbol("fineness", positive=True)


@dataclass(frozen=True)
class Field:
    """A scalar or a vector field that is linear on each element.

    Attributes
    ----------
    name : str
    dimension : 2 or 3
        Of space.
    vector : bool
    """

    name: str
    dimension: int
    vector: bool = False

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
    def mean(self) -> Any:
        """Its mean over the element."""
        means = [Symbol(f"{name}_mean", real=True) for name in self.components]
        return Matrix(means) if self.vector else means[0]

    @property
    def test(self) -> Field:
        """Its test function."""
        return Field(f"{self.name}_test", self.dimension, self.vector)

    def nodal(self, node: int) -> tuple[Symbol, ...]:
        """Its components at a node of an element."""
        return tuple(Symbol(f"{name}_n{node}", real=True) for name in self.components)


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
    """A weak form on triangles or tetrahedra.

    Parameters
    ----------
    name : str
    dimension : 2 or 3
    fields : tuple of Field
        Unknown.
    coefficients : tuple of Field
        Known: given at the nodes, or where a scene says so uniform, or absent.
    terms : mapping from str to Expr
        What is integrated, by name.
    parameters : tuple of Symbol
        Numbers.
    quantities : mapping from Symbol to Expr
        What is constant on an element, each in terms of earlier ones, of means and gradients of fields, and
        :data:`FINENESS`.
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
    source: str = ""

    def __post_init__(self) -> None:
        faults = _faults(self)
        if faults:
            raise LawError(self.name, tuple(faults), "weak form")


def _faults(form: WeakForm) -> list[str]:
    fields = (*form.fields, *form.coefficients)
    faults = [f"field {one.name} is of {one.dimension} dimensions" for one in fields if one.dimension != form.dimension]
    own = [*form.parameters, *form.quantities]
    names = [one.name for one in (*fields, *own)]
    # own_NAME is what it is called in code, and own_NAME_mean its mean
    faults += [f"the name {name!r} is not of letters and digits" for name in names if not NAME.fullmatch(name)]
    taken = [name.removeprefix("own_") for one in fields for name in one.components] + [symbol.name for symbol in own]
    faults += [f"two things are named {name}" for name in sorted({name for name in taken if taken.count(name) > 1})]
    faults += [] if form.name.isidentifier() else [f"the form's name {form.name!r} is no identifier"]
    at_points = {s for one in fields for s in one.values}
    constants = {FINENESS, *form.parameters}
    constants |= {s for one in fields for row in one.gradients for s in row}
    constants |= {s for one in fields for s in Matrix([one.mean]).free_symbols}
    for symbol, expr in form.quantities.items():
        faults += _unknown(f"quantity {symbol}", expr, constants)
        constants.add(symbol)
    tests = of_tests(form)
    for name, term in form.terms.items():
        faults += _unknown(f"term {name!r}", term, constants | at_points | set(tests))
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


def of_tests(form: WeakForm) -> list[Symbol]:
    """Values and gradients of the test functions."""
    tests = [one.test for one in form.fields]
    return [s for one in tests for k, value in enumerate(one.values) for s in (value, *one.gradients[k])]


def in_code(form: WeakForm, expr: Expr) -> Expr:
    """An expression with the form's own parameters and quantities named as in generated code."""
    return expr.xreplace({s: own_symbol(s) for s in (*form.parameters, *form.quantities)})


def own_symbol(symbol: Symbol) -> Symbol:
    """A parameter or a quantity of a form as it is named in generated code."""
    return Symbol(f"own_{symbol.name}", **symbol.assumptions0)


def form_hash(form: WeakForm) -> str:
    """Fingerprint of what a form declares."""
    parts = [form.dimension, form.fields, form.coefficients, form.parameters]
    texts = [*map(repr, parts), *(f"{name} {srepr(expr)}" for name, expr in form.terms.items())]
    texts += [f"{symbol} {srepr(expr)}" for symbol, expr in form.quantities.items()]
    return sha256("\n".join(texts).encode()).hexdigest()[:12]
