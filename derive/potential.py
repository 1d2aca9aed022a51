"""Declaring a potential: an energy of two particles that depends on the distance of their centres.

A potential is one expression, U(r), in these symbols and in parameters of its own; the force that pushes the two apart,
F = -dU/dr, and its slope dF/dr are derived:

========== ========================================================== =========
symbol     meaning                                                    dimension
========== ========================================================== =========
r          distance of the centres, > 0                               length
contact    distance at which the surfaces touch, the sum of the radii length
age        time that the two have been within the cut-off             time
shear_rate size of the shear rate of the background flow              1/time
========== ========================================================== =========

The last two stand in ``activation`` alone, a factor of the energy that time changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from hashlib import sha256

from sympy import Expr, Interval, Piecewise, Rational, S, Symbol, diff, oo, srepr, true

from softdyn.derive.branches import in_plain_functions
from softdyn.derive.checks import chains, dimension_faults, is_monomial, is_range, name_faults, node_faults
from softdyn.derive.checks import parameter_faults as own_faults
from softdyn.derive.dimensions import (
    DIMENSIONLESS,
    ENERGY,
    FORCE,
    LENGTH,
    TIME,
    Dimension,
    DimensionMismatchError,
    dimension_of,
)
from softdyn.derive.law import Limit
from softdyn.errors import LawError

r = Symbol("r", positive=True)
contact = Symbol("contact", positive=True)
age = Symbol("age", nonnegative=True)
shear_rate = Symbol("shear_rate", nonnegative=True)

U, F, F_r = (Symbol(name, real=True) for name in ("U", "F", "F_r"))

#: What an energy, and what an activation, may use without declaring it, with its dimension.
DISTANCES: dict[Symbol, Dimension] = {r: LENGTH, contact: LENGTH}
TIMES: dict[Symbol, Dimension] = {age: TIME, shear_rate: TIME**-1}
#: What may be claimed of a potential, with its dimension.
CLAIMABLE: dict[Symbol, Dimension] = {U: ENERGY, F: FORCE, F_r: FORCE / LENGTH}


@dataclass(frozen=True, eq=False)
class Potential:
    """A potential: an energy in the symbols of :mod:`softdyn.derive.potential`.

    Parameters
    ----------
    name : str
        A lower-case identifier.
    energy : Expr
        U(r), up to a constant.
    parameters : mapping from Symbol to Dimension
        The potential's own.
    domain : (low, high)
        Distances between which it holds, each an expression in the parameters, 0 or ``oo``. What is beyond is refused:
        a chain that may not be stretched further.
    activation : Expr
        A factor of the energy, of ``age`` and ``shear_rate``: 1 if not declared.
    ranges : mapping from Symbol to (low, high), or to Interval
        Values that a parameter may take, as a law's.
    typical : mapping from Symbol to number
        Exact numbers.
    limits : tuple of Limit
        What its author claims of "U", "F" = -dU/dr and "F_r" = dF/dr, in ``order`` of products of powers of r and of
        the parameters, or of differences of r and a distance, such as ``r - d``. ``softdyn check`` proves or disproves
        it.
    source, description : str

    Raises
    ------
    LawError
        Listing every fault.
    """

    name: str
    energy: Expr
    parameters: Mapping[Symbol, Dimension] = field(default_factory=dict)
    domain: tuple[Expr | int, Expr | int] = (0, oo)
    activation: Expr = S.One
    ranges: Mapping[Symbol, Interval | tuple[Expr | int, Expr | int]] = field(default_factory=dict)
    typical: Mapping[Symbol, Expr | int] = field(default_factory=dict)
    limits: tuple[Limit, ...] = ()
    source: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        for name in ("energy", "activation"):
            value = getattr(self, name)
            value = S(value) if isinstance(value, (int, Rational)) else value
            object.__setattr__(self, name, in_plain_functions(value) if isinstance(value, Expr) else value)
        object.__setattr__(self, "limits", tuple(self.limits))
        faults = faults_of(self)
        if faults:
            raise LawError(str(self.name), tuple(faults), "potential")


def force_of(potential: Potential) -> dict[Symbol, Expr]:
    """What follows from a potential: U, the force F = -dU/dr that pushes the two apart, and dF/dr.

    Without the activation, which is a factor of all of them.
    """
    energy = potential.energy
    return {U: energy, F: -diff(energy, r), F_r: -diff(energy, r, 2)}


def dimensions_for(potential: Potential) -> dict[Symbol, Dimension]:
    """Dimensions of every symbol that an energy may use."""
    return {**DISTANCES, **potential.parameters}


def ranges_of(potential: Potential) -> dict[Symbol, Interval]:
    """Values that parameters may take."""
    return {x: one if isinstance(one, Interval) else Interval.open(*one) for x, one in potential.ranges.items()}


def is_active(potential: Potential) -> bool:
    """Whether it has all of its energy at all times."""
    return bool(potential.activation == 1)


def potential_hash(potential: Potential) -> str:
    """Digest of what a potential's kernel depends on."""
    parts = [potential.energy, *map(S, potential.domain), potential.activation, *potential.parameters]
    ranges = [f"{symbol}: {one}" for symbol, one in ranges_of(potential).items()]
    return sha256("\n".join([*map(srepr, parts), *ranges]).encode()).hexdigest()[:16]


# ---------------------------------------------------------------------------------------------------------- checks


def faults_of(potential: Potential) -> list[str]:
    """Every fault of a potential, as messages for its author; an empty list if there are none."""
    faults = name_faults(potential.name)
    if not isinstance(potential.parameters, Mapping):
        return [*faults, f"parameters = {potential.parameters!r} must map symbols to dimensions"]
    faults += own_faults(potential)
    taken = {symbol.name: symbol for symbol in (*DISTANCES, *TIMES, *CLAIMABLE)}
    faults += [
        f"parameters: {symbol} is what a potential {'gives' if taken[symbol.name] in CLAIMABLE else 'may use'} already"
        for symbol in potential.parameters
        if getattr(symbol, "name", "") in taken
    ]
    if not all(isinstance(x, Symbol) and isinstance(unit, Dimension) for x, unit in potential.parameters.items()):
        return faults  # what follows relies on them
    faults += _expression_faults(potential, "energy", potential.energy, ENERGY, DISTANCES)
    faults += _expression_faults(potential, "activation", potential.activation, DIMENSIONLESS, TIMES)
    faults += _domain_faults(potential)
    if isinstance(potential.energy, Expr) and not faults and not potential.energy.has(r):
        faults.append(f"energy = {potential.energy} does not depend on the distance r: it makes no force")
    faults += _typical_faults(potential)
    for limit in potential.limits:
        faults += [f"limit {limit.name!r}: {fault}" for fault in _limit_faults(potential, limit)]
    return faults


def _expression_faults(
    potential: Potential, name: str, expr: object, unit: Dimension | None, arguments: Mapping[Symbol, Dimension]
) -> list[str]:
    if not isinstance(expr, Expr):
        return [f"{name} = {expr!r} is a {type(expr).__name__}, not a sympy expression"]
    known = {**arguments, **potential.parameters}
    faults = _unknown(name, expr, known) + node_faults(name, expr)
    if not faults and unit is not None:
        faults = dimension_faults(name, expr, unit, known)
    faults += [
        f"{name}: {cases} has no value where no branch applies; end it with a default, (expression, True)"
        for cases in expr.atoms(Piecewise)
        if cases.args[-1][1] != true
    ]
    return faults


def _unknown(name: str, expr: Expr, allowed: Mapping[Symbol, Dimension]) -> list[str]:
    known = {symbol.name: symbol for symbol in allowed}
    faults = []
    for symbol in sorted(expr.free_symbols - set(allowed), key=str):
        if symbol.name in known:
            faults.append(
                f"{name}: this {symbol.name!r} is another symbol than softdyn's, or the one declared in parameters "
                "(its assumptions differ); use 'from softdyn.derive.potential import ...'"
            )
        elif symbol in TIMES:
            faults.append(f"{name}: {symbol} may stand in activation alone: a factor of the energy that time changes")
        else:
            near = get_close_matches(symbol.name, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else "declare it in parameters={symbol: dimension}"
            faults.append(f"{name}: symbol {symbol.name!r} is not allowed here; allowed: {', '.join(known)}; {hint}")
    return faults


def _domain_faults(potential: Potential) -> list[str]:
    domain = potential.domain
    if not isinstance(domain, (tuple, list)) or len(domain) != 2:
        return [f"domain = {domain!r} needs two distances, (low, high)"]
    faults = []
    for end, unbounded in zip(domain, (S.Zero, oo), strict=True):
        if S(end) == unbounded:
            continue
        faults += _expression_faults(potential, "domain", S(end), LENGTH, {contact: LENGTH})
    if not faults and all(not end.free_symbols for end in (S(domain[0]), S(domain[1]))) and not domain[0] < domain[1]:
        faults.append(f"domain: {domain[0]} is not below {domain[1]}")
    return faults


def _typical_faults(potential: Potential) -> Iterator[str]:
    ranges = ranges_of(potential) if all(map(is_range, potential.ranges.values())) else {}
    for symbol, value in potential.typical.items():
        number = S(value)
        if symbol not in potential.parameters:
            yield f"typical: {symbol} is not among the potential's own parameters"
        elif not number.is_Rational:
            yield f"typical: {symbol} = {value} must be an exact number"
        elif (symbol.is_positive and not number > 0) or (symbol in ranges and number not in ranges[symbol]):
            yield f"typical: {symbol} = {value} lies outside its range"


def distance_from(member: Expr) -> Expr | None:
    """What r is compared with in a difference such as r - d or d + Q - r; None of anything else."""
    slope = member.diff(r)
    return None if not member.is_Add or slope not in (1, -1) else -slope * (member - slope * r)


def _limit_faults(potential: Potential, limit: Limit) -> list[str]:
    order = chains(limit)
    if not all(isinstance(chain, tuple) and len(chain) >= 2 for chain in order):
        return [f"order must hold sizes, from smallest to largest, such as (r, sigma), not {limit.order}"]
    known, faults = dimensions_for(potential), []
    members = [S(member) for chain in order for member in chain]
    for member in members:
        found = _unknown("order", member, known)
        if not found and not is_monomial(member) and distance_from(member) is None:
            found = [f"order: {member} is no product of powers, and no difference of r and a distance, such as r - d"]
        faults += found
    if not any(member.free_symbols for member in members):
        faults.append(f"order must say what is small or large, as (r, sigma) does; {limit.order} does not")
    for chain in () if faults else order:
        units = {str(dimension_of(S(x), known) or DIMENSIONLESS) for x in chain}
        if len(units) > 1:
            faults.append(f"order compares {' with '.join(sorted(units))} in {chain}")
    if limit.within or limit.where:
        faults.append("errors of a potential's limits cannot be claimed yet: leave out within and where")
    for quantity, form in limit.claims.items():
        about = claimed_of(quantity)
        if about is None:
            named = ", ".join(repr(symbol.name) for symbol in CLAIMABLE)
            faults.append(f"cannot claim {quantity!r}; one can claim {named}, or expressions in them")
            continue
        bad = _expression_faults(potential, f"{quantity}", form, None, DISTANCES)
        bad += _unknown(f"{quantity}", about, {**known, **CLAIMABLE})
        if not bad:
            try:
                unit = dimension_of(about, {**known, **CLAIMABLE}) or DIMENSIONLESS
                bad = dimension_faults(f"{quantity}", form, unit, known)
            except DimensionMismatchError as error:
                bad = [f"{quantity}: {error}"]
        faults += bad
    return faults


def claimed_of(quantity: str | Expr) -> Expr | None:
    """What a claim is about, in U, F and F_r; None if there is nothing of that name."""
    if isinstance(quantity, Expr):
        return quantity if quantity.free_symbols & CLAIMABLE.keys() else None
    return next((symbol for symbol in CLAIMABLE if symbol.name == quantity), None)


def sample_values(potential: Potential) -> dict[Symbol, Rational]:
    """Values of all symbols: typical, or at least allowed and different; other ones of order one."""
    ranges = ranges_of(potential)
    values = {r: Rational(7, 5), contact: Rational(9, 7)}
    for i, symbol in enumerate(potential.parameters):
        allowed = ranges.get(symbol, Interval(0, 1))
        values[symbol] = allowed.start + (allowed.end - allowed.start) * Rational(3 + 2 * i, 7 + 2 * i)
    return {**values, **{symbol: S(value) for symbol, value in potential.typical.items()}}
