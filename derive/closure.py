"""Declaring a closure: what the fluid between grains does that is not resolved.

A closure is one expression: the drag on a grain, the viscosity of the mixture, the permeability of a bed, or hindered
settling. Its arguments are these symbols, and parameters of its own:

========= ==================================================== =========
symbol    meaning                                              dimension
========= ==================================================== =========
Re        2 r rho slip/eta                                     none
c         volume fraction of the fluid, 1 - phi                none
phi       volume fraction of the grains                        none
slip      velocity of a grain less that of the fluid, its size velocity
r         radius of a grain                                    length
rho       density of the fluid                                 density
eta       its viscosity                                        viscosity
========= ==================================================== =========

The velocities are means over the grains, and over the fluid alone; c slip is the superficial velocity. Grains feel
-V grad p besides the drag: the pressure is shared by the two phases.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches

from sympy import Expr, Interval, Piecewise, Pow, Rational, S, Symbol, log, pi, simplify, true

from softdyn.derive.branches import in_plain_functions
from softdyn.derive.checks import chains, dimension_faults, is_monomial, is_range, name_faults, node_faults
from softdyn.derive.checks import parameter_faults as own_faults
from softdyn.derive.dimensions import (
    DIMENSIONLESS,
    FRICTION,
    LENGTH,
    MASS,
    TIME,
    VISCOSITY,
    Dimension,
    DimensionMismatchError,
    dimension_of,
)
from softdyn.derive.law import Limit
from softdyn.derive.symbols import eta as eta  # one of the arguments that closures are written in
from softdyn.errors import LawError
from softdyn.verdicts import found_of

Re = Symbol("Re", positive=True)
c = Symbol("c", positive=True)
phi = Symbol("phi", positive=True)
slip = Symbol("slip", positive=True)
r = Symbol("r", positive=True)
rho = Symbol("rho", positive=True)

#: What Re stands for: the diameter of a grain, and its slip.
REYNOLDS = 2 * r * rho * slip / eta
#: The slip at a given Re.
SLIP = slip * Re / REYNOLDS

#: What a closure may use without declaring it, with its dimension.
ARGUMENTS: dict[Symbol, Dimension] = {
    Re: DIMENSIONLESS,
    c: DIMENSIONLESS,
    phi: DIMENSIONLESS,
    slip: LENGTH / TIME,
    r: LENGTH,
    rho: MASS / LENGTH**3,
    eta: VISCOSITY,
}

drag = Symbol("drag", positive=True)
viscosity = Symbol("viscosity", positive=True)
permeability = Symbol("permeability", positive=True)
settling = Symbol("settling", positive=True)

#: What a closure may give, with its dimension: a force on a grain over its slip; the viscosity of the mixture; k in
#: c slip = -k grad(p)/eta; the superficial velocity of grains that settle, over that of one grain alone.
GIVES: dict[Symbol, Dimension] = {
    drag: FRICTION,
    viscosity: VISCOSITY,
    permeability: LENGTH**2,
    settling: DIMENSIONLESS,
}

#: The drag coefficient, force over pi r^2 rho slip^2/2, of what gives the drag: it may be claimed by this name.
DRAG_COEFFICIENT = 4 * drag / (pi * r * eta * Re)


@dataclass(frozen=True, eq=False)
class Closure:
    """A closure: an expression in the symbols of :mod:`softdyn.derive.closure`.

    Parameters
    ----------
    name : str
        A lower-case identifier.
    gives : str
        "drag", "viscosity", "permeability" or "settling".
    expression : Expr
    in_plane : Expr, optional
        Of a drag, the same on a disc, for each length of it along its axis: force/velocity/length.
    parameters : mapping from Symbol to Dimension
        The closure's own.
    ranges : mapping from Symbol to (low, high), or to Interval
        Values that a parameter may take, as a law's.
    typical : mapping from Symbol to number
        Exact numbers, in SI units.
    limits : tuple of Limit
        What its author claims, in ``order`` of products of powers of symbols, 1, or differences such as
        ``phi_max - phi``; ``claims`` of what it gives, of "C_d", or of an expression in what it gives, as
        ``{viscosity/eta - 1: 5*phi/2}``. ``softdyn check`` proves or disproves it.
    source, description : str

    Raises
    ------
    LawError
        Listing every fault: a wrong argument, a wrong dimension, a value that is not positive, with numbers.
    """

    name: str
    gives: str
    expression: Expr
    in_plane: Expr | None = None
    parameters: Mapping[Symbol, Dimension] = field(default_factory=dict)
    ranges: Mapping[Symbol, Interval | tuple[Expr | int, Expr | int]] = field(default_factory=dict)
    typical: Mapping[Symbol, Expr | int] = field(default_factory=dict)
    limits: tuple[Limit, ...] = ()
    source: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        for name in ("expression", "in_plane"):
            value = getattr(self, name)
            object.__setattr__(self, name, in_plain_functions(value) if isinstance(value, Expr) else value)
        object.__setattr__(self, "limits", tuple(self.limits))
        faults, _ = found_of(self, faults_of, lambda closure: [])
        if faults:
            raise LawError(str(self.name), tuple(faults), "closure")


def result_of(closure: Closure) -> Symbol:
    """Return the symbol of what a closure gives."""
    return next(symbol for symbol in GIVES if symbol.name == closure.gives)


def dimensions_for(closure: Closure) -> dict[Symbol, Dimension]:
    """Dimensions of every symbol that a closure may use."""
    return {**ARGUMENTS, **closure.parameters}


def ranges_of(closure: Closure) -> dict[Symbol, Interval]:
    """Values that parameters, and volume fractions, may take."""
    own = {x: one if isinstance(one, Interval) else Interval.open(*one) for x, one in closure.ranges.items()}
    return {c: Interval.open(0, 1), phi: Interval.open(0, 1), **own}


def claimed_of(closure: Closure, quantity: str | Expr) -> Expr | None:
    """What a claim is about, in what the closure gives; None if a closure has nothing of that name."""
    result = result_of(closure)
    if isinstance(quantity, Expr):
        return quantity if quantity.has(result) else None
    named = {result.name: result, **({"C_d": DRAG_COEFFICIENT} if result == drag else {})}
    return named.get(quantity)


def in_fractions(closure: Closure, expr: Expr, varying: Symbol = c) -> Expr:
    """An expression in Re and one of the two volume fractions, c or phi, without the slip.

    Parameters
    ----------
    closure : Closure
    expr : Expr
    varying : Symbol
        The fraction that stays.
    """
    other = phi if varying == c else c
    return expr.subs({slip: SLIP, other: 1 - varying}, simultaneous=True)


def densest(closure: Closure) -> Expr:
    """The largest volume fraction of the grains: 1, or where a power or a logarithm has no value before that."""
    values = sample_values(closure)
    expr = in_fractions(closure, closure.expression, phi)
    found = {S.One: S.One}
    for node in expr.atoms(Pow, log):
        base = node.args[0]
        slope = base.diff(phi)
        singular = isinstance(node, log) or node.exp.is_negative or not node.exp.is_integer
        if singular and slope != 0 and not slope.has(phi):
            root = simplify(-base.subs(phi, 0) / slope)
            if root.free_symbols <= closure.parameters.keys() and 0 < root.subs(values) < 1:
                found[root.subs(values)] = root
    return found[min(found)]


def faults_of(closure: Closure) -> list[str]:
    """Every fault of a closure, as messages for its author; an empty list if there are none."""
    faults = name_faults(closure.name)
    names = [symbol.name for symbol in GIVES]
    if closure.gives not in names:
        faults.append(f"gives = {closure.gives!r} must be one of {', '.join(names)}")
    if not isinstance(closure.parameters, Mapping):
        return [*faults, f"parameters = {closure.parameters!r} must map symbols to dimensions"]
    taken = {symbol.name: symbol for symbol in (*ARGUMENTS, *GIVES)}
    faults += own_faults(closure)
    faults += [
        f"parameters: {symbol} is what a closure {'gives' if taken[symbol.name] in GIVES else 'may use'} already"
        for symbol in closure.parameters
        if getattr(symbol, "name", "") in taken and symbol != eta
    ]
    if closure.gives not in names or not all(
        isinstance(symbol, Symbol) and isinstance(unit, Dimension) for symbol, unit in closure.parameters.items()
    ):
        return faults  # what follows relies on them
    unit = GIVES[result_of(closure)]
    declared: dict[str, tuple[object, Dimension]] = {"expression": (closure.expression, unit)}
    if closure.in_plane is not None:
        declared["in_plane"] = (closure.in_plane, unit / LENGTH)
        if closure.gives != "drag":
            faults.append(f"in_plane is of a drag; this closure gives {closure.gives}")
    for name, (expr, dimension) in declared.items():
        faults += _expression_faults(closure, name, expr, dimension)
    faults += _typical_faults(closure)
    for limit in closure.limits:
        faults += [f"limit {limit.name!r}: {fault}" for fault in _limit_faults(closure, limit)]
    return faults or _sign_faults(closure)


def _expression_faults(closure: Closure, name: str, expr: object, dimension: Dimension | None) -> list[str]:
    if not isinstance(expr, Expr):
        return [f"{name} = {expr!r} is a {type(expr).__name__}, not a sympy expression"]
    faults = _unknown(closure, name, expr, ()) + node_faults(name, expr)
    if not faults and dimension is not None:
        faults = dimension_faults(name, expr, dimension, dimensions_for(closure))
    faults += [
        f"{name}: {cases} has no value where no branch applies; end it with a default, (expression, True)"
        for cases in expr.atoms(Piecewise)
        if cases.args[-1][1] != true
    ]
    return faults


def _unknown(closure: Closure, name: str, expr: Expr, more: tuple[Symbol, ...]) -> list[str]:
    known = {symbol.name: symbol for symbol in (*dimensions_for(closure), *more)}
    faults = []
    for symbol in sorted(expr.free_symbols - set(known.values()), key=str):
        if symbol.name in known:
            faults.append(
                f"{name}: this {symbol.name!r} is another symbol than softdyn's, or the one declared in parameters "
                "(its assumptions differ); use 'from softdyn.derive.closure import ...'"
            )
            continue
        near = get_close_matches(symbol.name, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else "declare it in parameters={symbol: dimension}"
        faults.append(f"{name}: symbol {symbol.name!r} is not allowed here; allowed: {', '.join(known)}; {hint}")
    return faults


def _typical_faults(closure: Closure) -> list[str]:
    ranges = ranges_of(closure) if all(map(is_range, closure.ranges.values())) else {}
    faults = []
    for symbol, value in closure.typical.items():
        number = S(value)
        if symbol not in closure.parameters:
            faults.append(f"typical: {symbol} is not among the closure's own parameters")
        elif not number.is_Rational:
            faults.append(f"typical: {symbol} = {value} must be an exact number")
        elif (symbol.is_positive and not number > 0) or (symbol in ranges and number not in ranges[symbol]):
            faults.append(f"typical: {symbol} = {value} lies outside its range")
    return faults


def size_of(member: Expr) -> tuple[Symbol, Expr] | None:
    """The volume fraction, and what it is less than, of a difference that is ordered, such as phi_max - phi."""
    for symbol in (phi, c):
        rest = member + symbol
        if member.is_Add and not rest.has(symbol) and is_monomial(rest):
            return symbol, rest
    return None


def _limit_faults(closure: Closure, limit: Limit) -> list[str]:
    faults = []
    order = chains(limit)
    if not all(isinstance(chain, tuple) and len(chain) >= 2 for chain in order):
        return [f"order must hold sizes, from smallest to largest, such as (Re, 1), not {limit.order}"]
    members = [S(member) for chain in order for member in chain]
    for member in members:
        found = _unknown(closure, "order", member, ())
        if not found and not (is_monomial(member) or size_of(member)):
            found = [f"order: {member} is no product of powers, and no difference such as phi_max - phi"]
        faults += found
    if not any(member.free_symbols for member in members):
        faults.append(f"order must say what is small or large, as (Re, 1) does; {limit.order} does not")
    if any(member.has(c) for member in members) and any(member.has(phi) for member in members):
        faults.append("order has both c and phi, which is 1 - c: name one of them")
    for chain in () if faults else order:
        units = {str(dimension_of(S(x), dimensions_for(closure)) or DIMENSIONLESS) for x in chain}
        if len(units) > 1:
            faults.append(f"order compares {' with '.join(sorted(units))} in {chain}")
    if limit.within or limit.where:
        faults.append("errors of a closure's limits cannot be claimed yet: leave out within and where")
    result = result_of(closure)
    known = {**dimensions_for(closure), result: GIVES[result]}
    for quantity, form in limit.claims.items():
        about = claimed_of(closure, quantity)
        if about is None:
            also = ", 'C_d'" if result == drag else ""
            faults.append(f"cannot claim {quantity!r}; one can claim {result.name!r}{also}, or expressions in it")
            continue
        bad = _expression_faults(closure, f"{quantity}", form, None) + _unknown(
            closure, f"{quantity}", about, (result,)
        )
        if not bad:
            try:
                unit = dimension_of(about, known) or DIMENSIONLESS
                bad = dimension_faults(f"{quantity}", form, unit, known)
            except DimensionMismatchError as error:
                bad = [f"{quantity}: {error}"]
        faults += bad
    return faults


def sample_values(closure: Closure) -> dict[Symbol, Rational]:
    """Values of all symbols: typical, or at least allowed and different; other ones of order one."""
    own, ranges = tuple(closure.parameters), ranges_of(closure)
    values = {Re: Rational(3, 2), c: Rational(3, 5), phi: Rational(2, 5), r: Rational(7, 5), rho: Rational(9, 7)}
    values |= {eta: Rational(11, 9), slip: S.One}
    for i, symbol in enumerate(own):
        allowed = ranges.get(symbol, Interval(0, 1))
        values[symbol] = allowed.start + (allowed.end - allowed.start) * Rational(3 + 2 * i, 7 + 2 * i)
    return {**values, **{symbol: S(value) for symbol, value in closure.typical.items()}}


def _sign_faults(closure: Closure) -> list[str]:
    """What a closure gives is positive."""
    from softdyn.derive.closure_signs import signs_of_closure

    return [
        f"{sign.name} must be positive, but {sign.at}"
        for sign in signs_of_closure(closure)
        if sign.verdict == "negative"
    ]
