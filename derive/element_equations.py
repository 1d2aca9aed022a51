"""The equations of one element of a weak form: residual and Jacobian, in the values at its nodes.

Input: a :class:`WeakForm`. Output: each entry in terms of coordinates, fields, coefficients and parameters.

The element is a simplex of d + 1 nodes, lambda_i its shape functions. A term is linear in the test functions, so that
its part of the residual of node i is the integral of lambda_i times its derivative by the test function's value, and
grad lambda_i times the integral of that by the test function's gradient. These derivatives are polynomials in what
varies over the element, and polynomials are integrated exactly:

    integral of prod lambda_i^a_i = |T| d! prod a_i!/(d + sum a_i)!

The Jacobian is the derivative of these integrals along the definitions, exact, term by term.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import product
from math import factorial, prod

from sympy import Expr, Matrix, Poly, PolynomialError, Rational, S, Symbol, diff, expand, ilcm

from softdyn.derive.equations import Equations
from softdyn.derive.weak_form import FINENESS, Field, WeakForm, in_code, of_tests, own_symbol
from softdyn.errors import LawError

#: Determinant of an element's edges: d! its measure, and positive if it is not inverted.
determinant, measure = Symbol("determinant", real=True), Symbol("measure", real=True)


@dataclass(frozen=True)
class ElementNeeds:
    """What a scene needs of the kernel of its elements.

    Parameters
    ----------
    uniform : tuple of str
        Coefficients that are the same at all nodes.
    absent : tuple of str
        Coefficients that are zero.
    """

    uniform: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()


@dataclass(frozen=True)
class ElementEquations(Equations):
    """Equations of an element.

    ``absent`` and ``uniform`` are, for each coefficient, what is known where it is zero, and where it is the same at
    all nodes.
    """

    absent: dict[str, dict[Symbol, Expr]] = field(default_factory=dict)
    uniform: dict[str, dict[Symbol, Expr]] = field(default_factory=dict)


def coordinate(node: int, axis: int) -> Symbol:
    """Coordinate of a node."""
    return Symbol(f"at{axis}_n{node}", real=True)


def slope(node: int, axis: int) -> Symbol:
    """Derivative of a node's shape function."""
    return Symbol(f"slope{axis}_n{node}", real=True)


def residual_of(i: int) -> Symbol:
    """Residual that belongs to an unknown of the element."""
    return Symbol(f"residual{i}", real=True)


def entry_of(i: int, j: int) -> Symbol:
    """Derivative of that residual by an unknown."""
    return Symbol(f"matrix{i}_{j}", real=True)


def unknowns(form: WeakForm) -> list[Symbol]:
    """Unknowns of an element, node by node."""
    return [symbol for node in range(form.dimension + 1) for one in form.fields for symbol in one.nodal(node)]


def geometry(d: int) -> dict[Symbol, Expr]:
    """Edges, determinant, measure and the slopes of the shape functions of a simplex."""
    edges = Matrix(d, d, lambda m, i: Symbol(f"edge{m}_n{i + 1}", real=True))
    found = {edges[m, i]: coordinate(i + 1, m) - coordinate(0, m) for i in range(d) for m in range(d)}
    # lambda_i of the nodes but the first are the coordinates along the edges
    cofactors = edges.adjugate()
    named = {(i, m): Symbol(f"cofactor{m}_n{i + 1}", real=True) for i in range(d) for m in range(d)}
    found |= {symbol: cofactors[place] for place, symbol in named.items()}
    inverse = Symbol("inverse", real=True)
    found[determinant] = sum((edges[m, 0] * named[0, m] for m in range(d)), start=S.Zero)
    found |= {measure: determinant / factorial(d), inverse: 1 / determinant}
    found |= {slope(i + 1, m): symbol * inverse for (i, m), symbol in named.items()}
    found |= {slope(0, m): -sum((slope(i + 1, m) for i in range(d)), start=S.Zero) for m in range(d)}
    found[FINENESS] = sum((slope(i, m) ** 2 for i in range(d + 1) for m in range(d)), start=S.Zero)
    return found


def total_of(component: str) -> Symbol:
    """Sum of a field's component over the nodes."""
    return Symbol(f"{component}_sum", real=True)


def at_nodes(one: Field) -> dict[Symbol, Expr]:
    """Sum, mean and gradient of a field, in its values at the nodes."""
    d = one.dimension
    found: dict[Symbol, Expr] = {}
    means = Matrix([one.mean])
    for k, component in enumerate(one.components):
        nodal = [one.nodal(node)[k] for node in range(d + 1)]
        found[total_of(component)] = sum(nodal, start=S.Zero)
        found[means[k]] = total_of(component) / (d + 1)
        for m, symbol in enumerate(one.gradients[k]):
            found[symbol] = sum((value * slope(node, m) for node, value in enumerate(nodal)), start=S.Zero)
    return found


@cache
def weight(d: int, indices: tuple[int, ...]) -> Rational:
    """Integral of a product of shape functions over a simplex, over its measure."""
    counts = Counter(indices)
    return Rational(factorial(d) * prod(map(factorial, counts.values())), factorial(d + len(indices)))


class _Integrals:
    """Integrals over an element, each named once."""

    def __init__(self, form: WeakForm) -> None:
        self.d = form.dimension
        self.form = form
        fields = [*form.coefficients, *form.fields]
        self.varying = [symbol for one in fields for symbol in one.values]
        self.known = {symbol for one in form.coefficients for symbol in one.values}
        self.nodal = {
            symbol: [one.nodal(node)[k] for node in range(self.d + 1)]
            for one in fields
            for k, symbol in enumerate(one.values)
        }
        self.named: dict[tuple[tuple[Symbol, ...], tuple[int, ...]], Symbol] = {}
        self.definitions: dict[Symbol, Expr] = {}

    def of(self, expr: Expr, *nodes: int) -> Expr:
        """Integral of an expression times the shape functions of some nodes."""
        found = S.Zero
        for powers, factor in self._polynomial(expr):
            factors = [symbol for symbol, power in zip(self.varying, powers, strict=True) for _ in range(power)]
            known = tuple(symbol for symbol in factors if symbol in self.known)
            sought = [symbol for symbol in factors if symbol not in self.known]
            for places in product(range(self.d + 1), repeat=len(sought)):
                values = prod((self.nodal[symbol][i] for symbol, i in zip(sought, places, strict=True)), start=S.One)
                found += factor * values * self._moment(known, tuple(sorted((*nodes, *places))))
        return found

    def _polynomial(self, expr: Expr) -> list[tuple[tuple[int, ...], Expr]]:
        try:
            return list(Poly(expand(expr), *self.varying).terms()) if expr != 0 else []
        except PolynomialError:
            fault = f"{expr} is no polynomial in the values of fields, and is not integrated exactly"
            raise LawError(self.form.name, (fault,), "weak form") from None

    def _moment(self, known: tuple[Symbol, ...], indices: tuple[int, ...]) -> Expr:
        """Integral of known fields times shape functions; of fewer fields it is named too, for where one is uniform."""
        if not known:
            constant = weight(self.d, indices)
            return constant.p * self._share(constant.q)
        if (known, indices) not in self.named:
            for i in range(len(known)):
                self._moment(known[:i] + known[i + 1 :], indices)
            common, total = self._sum(known, indices)
            name = Symbol(f"integral{len(self.named)}", real=True)
            self.definitions[name] = self._share(common) * total
            self.named[known, indices] = name
        return self.named[known, indices]

    def _share(self, of: int) -> Symbol:
        """That part of the measure, divided once."""
        symbol = Symbol(f"share{of}", real=True)
        self.definitions.setdefault(symbol, measure / of)
        return symbol

    def _sum(self, known: tuple[Symbol, ...], indices: tuple[int, ...]) -> tuple[int, Expr]:
        """An integral over the measure as a common denominator, and a sum with whole weights."""
        nodes = range(self.d + 1)
        weights = {places: weight(self.d, (*indices, *places)) for places in product(nodes, repeat=len(known))}
        common = int(ilcm(*(one.q for one in weights.values())))
        least = min(weights.values()) if len(known) == 1 else S.Zero
        total = common * least * total_of(known[0].name)  # what all nodes have in common by their sum
        for places, one in weights.items():
            values = prod((self.nodal[x][i] for x, i in zip(known, places, strict=True)), start=S.One)
            total += common * (one - least) * values
        return common, total

    def where(self, one: Field, uniform: bool) -> dict[Symbol, Expr]:
        """What is known of a coefficient and of its integrals where it is uniform, or zero."""
        found: dict[Symbol, Expr] = {}
        means = Matrix([one.mean])
        for k, symbol in enumerate(one.values):
            value = symbol if uniform else S.Zero
            found |= dict.fromkeys(self.nodal[symbol], value) | dict.fromkeys(one.gradients[k], S.Zero)
            found |= {total_of(symbol.name): (self.d + 1) * value, means[k]: value}
            for (known, indices), name in self.named.items():
                if symbol in known:
                    i = known.index(symbol)
                    found[name] = value * self._moment(known[:i] + known[i + 1 :], indices)
        return found


@lru_cache(maxsize=8)
def element_equations(form: WeakForm) -> ElementEquations:
    """Everything there is to say about an element, before any specialisation.

    Raises
    ------
    LawError
        If a term is no polynomial in the values of fields.
    """
    d = form.dimension
    definitions = geometry(d)
    for one in (*form.coefficients, *form.fields):
        definitions |= at_nodes(one)
    definitions |= {own_symbol(symbol): in_code(form, expr) for symbol, expr in form.quantities.items()}
    integrals = _Integrals(form)
    sought = unknowns(form)
    tested = [(one.test.values[k], one.test.gradients[k]) for one in form.fields for k in range(len(one.components))]
    slopes = {symbol: [diff(in_code(form, term), symbol) for term in form.terms.values()] for symbol in of_tests(form)}

    # integrals of the derivatives by the gradients of test functions, of which all nodes have a share
    fluxes: dict[Symbol, Expr] = {}
    flux_of: dict[Symbol, Symbol] = {}
    for symbol in (s for _, gradients in tested for s in gradients):
        form_of = sum((integrals.of(part) for part in slopes[symbol]), start=S.Zero)
        if form_of != 0:
            flux_of[symbol] = Symbol(f"flux{len(fluxes)}", real=True)
            fluxes[flux_of[symbol]] = form_of
    residuals = []
    for node in range(d + 1):
        for value, gradients in tested:
            local = sum((integrals.of(part, node) for part in slopes[value]), start=S.Zero)
            shares = (flux_of[s] * slope(node, m) for m, s in enumerate(gradients) if s in flux_of)
            residuals.append(local + sum(shares, start=S.Zero))
    definitions |= integrals.definitions | fluxes

    along = _Derivatives(definitions)
    definitions |= {residual_of(i): expr for i, expr in enumerate(residuals)}
    entries = {
        entry_of(i, j): along.of(expr, symbol) for i, expr in enumerate(residuals) for j, symbol in enumerate(sought)
    }
    definitions |= along.definitions | entries
    wanted = frozenset({residual_of(i) for i in range(len(residuals))} | set(entries))
    absent, uniform = ({x.name: integrals.where(x, of) for x in form.coefficients} for of in (False, True))
    return ElementEquations(definitions, wanted, absent, uniform)


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
