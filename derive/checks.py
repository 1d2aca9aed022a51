"""The faults of a declared law, all of them at once.

Input: the four expressions and the declared parameters. Output: a list of messages, each naming the expression, the
symbol at fault, what is allowed there and, where one suggests itself, the likely spelling.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import mpmath
from sympy import (
    Abs,
    Add,
    Basic,
    Dummy,
    Expr,
    Float,
    Interval,
    Max,
    Min,
    Mul,
    Piecewise,
    Pow,
    Rational,
    Symbol,
    acos,
    acosh,
    asin,
    asinh,
    atan,
    atanh,
    cos,
    cosh,
    erf,
    erfc,
    exp,
    lambdify,
    log,
    nan,
    nsimplify,
    oo,
    sign,
    simplify,
    sin,
    sinh,
    tan,
    tanh,
    true,
    zoo,
)
from sympy.core.function import AppliedUndef
from sympy.core.numbers import ComplexInfinity, ImaginaryUnit, Infinity, NaN, NegativeInfinity
from sympy.core.numbers import Exp1 as EulerNumber
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from softdyn.derive.bessel import Bessel
from softdyn.derive.branches import gap_of
from softdyn.derive.dimensions import (
    DIMENSIONLESS,
    FORCE,
    FRICTION,
    LENGTH,
    TIME,
    Dimension,
    DimensionMismatchError,
    dimension_of,
)
from softdyn.derive.not_negative import not_negative
from softdyn.derive.positive import Domain, Positivity, positivity, ranges_of_positive, ranges_of_symbol
from softdyn.derive.soundness import is_side, rewritable, tidy
from softdyn.derive.special import LambertW
from softdyn.derive.splines import Spline
from softdyn.derive.symbols import (
    COMMON_PARAMETERS,
    DIMENSIONS,
    MEANINGS,
    E,
    F,
    R,
    a,
    delta,
    eta,
    h,
    size_ratio,
    slip_rate,
)

if TYPE_CHECKING:
    from softdyn.derive.closure import Closure
    from softdyn.derive.law import ContactLaw, Limit
    from softdyn.derive.potential import Potential

#: The arguments and the dimension of each declared expression.
SIGNATURES = {
    "a": ((h, delta), LENGTH),
    "F_ela": ((a, delta), FORCE),
    "zeta": ((a, h), FRICTION),
    "F_adh": ((a, h), FORCE),
}
#: What a law that is declared general may use besides.
GENERAL = {"F_ela": (h,), "F_adh": (delta,)}

TANGENTIAL = {
    "sliding": ((a, h, size_ratio), FRICTION),
    "coupling": ((a, h, size_ratio), FRICTION * LENGTH),
    "rolling": ((a, h, size_ratio), FRICTION * LENGTH**2),
    "k_t": ((a, h), FORCE / LENGTH),
}

RUBBING = {
    "load": ((a, h, delta), FORCE),
    "k_t": ((a, h, delta), FORCE / LENGTH),
    "mu": ((h, slip_rate), DIMENSIONLESS),
}

DRAG = {
    "translation": ((), FRICTION),
    "rotation": ((), FRICTION * LENGTH**2),
}

#: Functions that every target prints.
PRINTABLE = (
    *(Abs, sign, exp, log, sin, cos, tan, asin, acos, atan),
    *(sinh, cosh, tanh, asinh, acosh, atanh, erf, erfc, LambertW, Min, Max, Piecewise),
)


def faults_of(law: ContactLaw) -> list[str]:
    """Every fault of a law, as messages for its author; an empty list if there are none."""
    faults = name_faults(law.name) + parameter_faults(law)
    if not isinstance(law.general, bool):
        faults.append(f"general = {law.general!r} must be True or False")
    if not all(isinstance(symbol, Symbol) and isinstance(d, Dimension) for symbol, d in law.parameters.items()):
        return faults  # what follows relies on them
    known = {symbol.name: symbol for symbol in (*DIMENSIONS, *law.parameters)}
    sound = True
    for name, (arguments, dimension) in SIGNATURES.items():
        expr = getattr(law, name)
        if not isinstance(expr, Expr):
            faults.append(f"{name} = {expr!r} is a {type(expr).__name__}, not a sympy expression")
            sound = False
            continue
        if name == "F_ela" and expr == oo:
            continue  # rigid
        allowed = (*arguments, *(GENERAL.get(name, ()) if law.general else ()))
        found = _symbol_faults(name, expr, allowed, law, known) + node_faults(name, expr)
        if not found:
            found = dimension_faults(name, expr, dimension, {**DIMENSIONS, **law.parameters})
        if not found:
            found = _gap_faults(name, expr, law)
        faults += found
        sound = sound and not found
    for part in (_tangential_faults, _rubbing_faults, _drag_faults, _dashpot_faults):
        faults += part(law, known)
    faults += _typical_faults(law) + _limit_faults(law, known) + _unequal_faults(law)
    if sound and not faults:
        faults += _one_sided_faults(law) or _origin_faults(law) or _positivity_faults(law)
    if sound and not faults and law.tangential is not None:
        faults += _tangential_positivity_faults(law)
    if sound and not faults and law.rubbing is not None:
        faults += _rubbing_sign_faults(law)
    return faults


def _tangential_faults(law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    if law.tangential is None:
        return []
    return _part_faults("tangential", "Tangential(sliding=..., k_t=...)", TANGENTIAL, law, known)


def _rubbing_faults(law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    if law.rubbing is None:
        return []
    return _part_faults("rubbing", "Rubbing(load=..., k_t=...)", RUBBING, law, known)


def _drag_faults(law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    faults = _part_faults("drag", "Drag(translation=..., rotation=...)", DRAG, law, known)
    for name in () if faults else DRAG:
        expr = tidy(getattr(law.drag, name))
        if expr.has(Spline):
            faults.append(f"drag {name} does not vary in a run: it takes no spline, but a number or a formula")
            continue
        found = _witness_of_part(expr, law)
        if found is not None:
            faults.append(f"drag {name} must be positive, but at {_point(found)} it is {mpmath.nstr(found.value, 6)}")
    return faults


def _unequal_faults(law: ContactLaw) -> list[str]:
    """The factor of unequal particles is a positive number, 1 of equal ones."""
    expr = law.unequal
    if not isinstance(expr, Expr):
        return [f"unequal = {expr!r} is a {type(expr).__name__}, not a sympy expression"]
    others = sorted(expr.free_symbols - {h, R, size_ratio}, key=str)
    found = [f"unequal: symbol {symbol.name!r} is not allowed here; allowed: h, R, size_ratio" for symbol in others]
    found += node_faults("unequal", expr)
    if found:
        return found
    found = dimension_faults("unequal", expr, DIMENSIONLESS, {**DIMENSIONS, size_ratio: DIMENSIONLESS})
    if found:
        return found
    of_equal = expr.subs(size_ratio, Rational(1, 4))
    if of_equal != 1 and simplify(of_equal - 1) != 0:
        return [f"unequal must be 1 of equal particles, but at size_ratio=1/4 it is {of_equal}"]
    sign_ = _witness_of_part(expr, law)
    if sign_ is not None:
        return [f"unequal must be positive for h > 0, but at {_point(sign_)} it is {mpmath.nstr(sign_.value, 6)}"]
    return []


def _dashpot_faults(law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    """The dashpot of a dry contact resists."""
    expr = law.dashpot
    if not isinstance(expr, Expr):
        return [f"dashpot = {expr!r} is a {type(expr).__name__}, not a sympy expression"]
    if expr == 0:
        return []
    if law.zeta != 0:
        return [f"dashpot = {expr} is for dry contacts: zeta = {law.zeta} is the friction of a film already"]
    faults = _symbol_faults("dashpot", expr, (a, delta), law, known) + node_faults("dashpot", expr)
    faults = faults or dimension_faults("dashpot", expr, FRICTION, {**DIMENSIONS, **law.parameters})
    if faults:
        return faults
    found = _witness_of_part(expr.subs(a, law.a).subs(delta, _SIZE), law)
    if found is not None:
        return [
            f"dashpot must be positive for 0 < delta < R, but at {_point(found)} it is {mpmath.nstr(found.value, 6)}"
        ]
    return []


def _part_faults(
    part: str,
    form: str,
    signatures: Mapping[str, tuple[tuple[Symbol, ...], Dimension]],
    law: ContactLaw,
    known: Mapping[str, Symbol],
) -> list[str]:
    """Faults of the expressions that a part of a law declares."""
    declared = getattr(law, part)
    if not all(hasattr(declared, name) for name in signatures):
        return [f"{part} = {declared!r} is a {type(declared).__name__}, not a {form}"]
    faults = []
    for name, (arguments, dimension) in signatures.items():
        expr = getattr(declared, name)
        where = f"{part} {name}"
        if name == "sliding" and expr == oo:
            continue  # surfaces of a dry contact stick, until friction lets them slide
        if not isinstance(expr, Expr):
            faults.append(f"{where} = {expr!r} is a {type(expr).__name__}, not a sympy expression")
            continue
        found = _symbol_faults(where, expr, arguments, law, known) + node_faults(where, expr)
        known_dimensions = {**DIMENSIONS, **law.parameters, size_ratio: DIMENSIONLESS, slip_rate: LENGTH / TIME}
        faults += found or dimension_faults(where, expr, dimension, known_dimensions) or _gap_faults(where, expr, law)
    return faults


def _tangential_positivity_faults(law: ContactLaw) -> list[str]:
    """Sliding and elasticity resist, and so does every combination of sliding and rolling."""
    t = law.tangential
    assert t is not None
    quantities = {"k_t": t.k_t}
    if t.sliding != oo:
        combined = t.sliding * t.rolling - (1 - 4 * size_ratio) * t.coupling**2
        quantities |= {"sliding": t.sliding}
    if t.sliding != oo and (t.rolling != 0 or t.coupling != 0):
        quantities |= {"sliding rolling - D^2 coupling^2": combined}
    faults = []
    sides = (1, -1) if t.sliding != oo else (1,)  # surfaces without a film touch where they are pressed alone
    for name, quantity in quantities.items():
        for side in sides:
            found = _witness_of_part(quantity.subs(a, law.a).subs(delta, side * _SIZE), law)
            if found is not None:
                faults.append(
                    f"tangential {name} must be positive for h > 0 and |delta| < R, but at {_point(found, side)} it is "
                    f"{mpmath.nstr(found.value, 6)}"
                )
                break
    return faults


def name_faults(name: object) -> list[str]:
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]{0,60}", name):
        return [f"name {name!r} must be a lower-case identifier: it names the generated files and functions"]
    return []


def parameter_faults(law: ContactLaw | Closure | Potential) -> list[str]:
    faults = []
    counts = Counter(str(getattr(symbol, "name", symbol)) for symbol in law.parameters)
    faults += [
        f"parameters: {name!r} is there {count} times, with different assumptions"
        for name, count in counts.items()
        if count > 1
    ]
    for symbol in law.parameters:
        if not isinstance(symbol, Symbol):
            faults.append(f"parameters: {symbol!r} is not a symbol; write Symbol({str(symbol)!r}, positive=True)")
        elif not isinstance(law.parameters[symbol], Dimension):
            faults.append(
                f"parameters: the dimension of {symbol} is {law.parameters[symbol]!r}; write one of softdyn.derive's, "
                "such as LENGTH or FORCE / LENGTH, or DIMENSIONLESS"
            )
        elif symbol.name in MEANINGS:
            faults.append(
                f"parameters: {symbol.name!r} is {MEANINGS[symbol.name]}; choose another name for one of your own"
            )
        elif not symbol.name.isidentifier():
            faults.append(f"parameters: {symbol.name!r} is no identifier: letters, digits and _, no digit first")
        elif not symbol.is_real:
            faults.append(
                f"parameters: {symbol.name!r} may be complex as declared; write Symbol({symbol.name!r}, positive=True),"
                " or real=True if it may be negative"
            )
    for symbol, bounds in law.ranges.items():
        if symbol not in law.parameters:
            faults.append(f"ranges: {symbol} is not among the law's own parameters")
        elif not is_range(bounds):
            faults.append(
                f"ranges: {symbol} needs (low, high), finite numbers with low < high, or an Interval of such, "
                f"not {bounds}"
            )
    return faults


def is_range(bounds: object) -> bool:
    """Whether these are two finite numbers, low and high, or an interval between such."""
    ends = (bounds.start, bounds.end) if isinstance(bounds, Interval) else bounds
    if not isinstance(ends, (tuple, list)) or len(ends) != 2:
        return False
    numbers = [isinstance(end, (int, float, Rational, Float)) and math.isfinite(float(end)) for end in ends]
    return all(numbers) and bool(ends[0] < ends[1])


def _symbol_faults(
    name: str, expr: Expr, arguments: tuple[Symbol, ...], law: ContactLaw, known: Mapping[str, Symbol]
) -> list[str]:
    allowed = {*arguments, *COMMON_PARAMETERS, *law.parameters}
    listing = ", ".join(symbol.name for symbol in (*arguments, *COMMON_PARAMETERS, *law.parameters))
    faults = []
    # which side of delta = 0 a state is on, any expression may ask
    for symbol in sorted(expr.replace(_is_side, lambda _: true).free_symbols - allowed, key=str):
        where = f"{name}({', '.join(s.name for s in arguments)}): symbol {symbol.name!r} is not allowed here"
        same = known.get(symbol.name)
        if same is not None and same != symbol:
            faults.append(
                f"{name}: this {symbol.name!r} is another symbol than softdyn's (its assumptions differ); "
                f"use 'from softdyn.derive import {symbol.name}'"
                if same in DIMENSIONS
                else f"{name}: this {symbol.name!r} has other assumptions than the one declared in parameters"
            )
        elif symbol in GENERAL.get(name, ()):
            faults.append(
                f"{where}; allowed: {listing}; that is the paper's restriction, which a law with general=True lifts"
            )
        elif name == "zeta" and symbol == delta:
            faults.append(f"{where}: the friction depends on the deflection through a only; allowed: {listing}")
        elif name == "zeta" and re.search(r"dot|dh|rate|velocity|^v$", symbol.name):
            faults.append(
                f"{where}: the viscous force must be linear in dh/dt (eq. 1), so zeta cannot depend on it; "
                f"allowed: {listing}"
            )
        else:
            near = get_close_matches(symbol.name, [s.name for s in allowed], n=1, cutoff=0.5)
            hint = f"; did you mean {near[0]!r}?" if near else "; declare it in parameters={symbol: dimension}"
            faults.append(f"{where}; allowed: {listing}{hint if same is None else ''}")
    return faults


def _is_side(node: Basic) -> bool:
    return isinstance(node, Relational) and is_side(node)


def node_faults(name: str, expr: Expr) -> list[str]:
    faults = []
    for node in sorted(expr.atoms(AppliedUndef), key=str):
        faults.append(f"{name}: {node} is an undefined function; write it out, or declare a parameter")
    for number in sorted(expr.atoms(Float), key=str):
        exact = nsimplify(number, rational=True)
        faults.append(
            f"{name}: {number} is inexact; numbers stay exact in a law: write Rational({exact.p!s}, {exact.q!s})"
        )
    for node in _unprintable(expr):
        near = get_close_matches(type(node).__name__, [f.__name__ for f in PRINTABLE], n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]}?" if near else ""
        bessel = "besselj, bessely, besseli, besselk of whole order (up to 2 of j and i)"
        listing = ", ".join(["sqrt", *(f.__name__ for f in PRINTABLE), bessel])
        faults.append(f"{name}: no target can print {node}; allowed functions: {listing}{hint}")
    return faults


def _unprintable(expr: Expr) -> list[Basic]:
    """Outermost nodes outside the grammar of printable expressions."""
    if expr.func in PRINTABLE or isinstance(expr, (Add, Mul, Pow, Bessel, Spline, Relational, BooleanFunction)):
        return [bad for argument in expr.args for bad in _unprintable(argument)]
    if isinstance(expr, (ImaginaryUnit, Infinity, NegativeInfinity, ComplexInfinity, NaN)):
        return [expr]
    if expr.is_Symbol or expr.is_number or isinstance(expr, (BooleanAtom, AppliedUndef)):
        return []
    if type(expr).__name__ == "ExprCondPair":
        return [bad for argument in expr.args for bad in _unprintable(argument)]
    return [expr]


def dimension_faults(name: str, expr: Expr, expected: object, known: Mapping[Symbol, object]) -> list[str]:
    """What is wrong with the dimension of an expression.

    Parameters
    ----------
    name : str
        Of what it is declared for.
    expr : Expr
    expected : Dimension
    known : mapping from Symbol to Dimension
        Of each symbol that it may use.
    """
    euler = "; its E is Euler's number: import E from softdyn.derive" if expr.has(EulerNumber) else ""
    try:
        found = dimension_of(expr, known)  # type: ignore[arg-type]
    except DimensionMismatchError as error:
        return [f"{name}: {error}{euler}"]
    if found is not None and found != expected:
        return [f"{name}: {expr} has the dimension {found}; {expected} is expected{euler}"]
    return []


def _gap_faults(name: str, expr: Expr, law: ContactLaw) -> list[str]:
    """A Piecewise without a default branch may have no value somewhere."""
    own = [symbol for symbol in law.parameters if symbol in expr.free_symbols]
    if not expr.has(Piecewise) or not all(map(is_range, law.ranges.values())):
        return []
    exact = {symbol: [nsimplify(sample, rational=True) for sample in _samples(symbol, law)] for symbol in own}
    found = gap_of(expr, exact)
    if found is None:
        return []
    cases, where = found
    shown = str(cases) if len(str(cases)) < 120 else f"the Piecewise of {len(cases.args)} branches"
    return [f"{name} has no value {where}: {shown} has no branch there; end it with a default, (expression, True)"]


#: Where what depends on the size ratio of two particles is looked at; gaps and deflections as powers of 10.
RATIOS = (Rational(0), Rational(1, 50), Rational(1, 8), Rational(1, 4))
GAPS = (-12, -9, -6, -4, -3, -2, -1, 0, 1, 2, 4)
DEFLECTIONS = (-14, -9, -6, -4, -2, -1, -0.3, -0.005)
#: abs(delta): one symbol, so that laws that are built on one another share what is found of common expressions.
_SIZE = Dummy("delta", positive=True)

CLAIMABLE = ("a", "zeta", "delta", "F", "F_ela", "F_adh", "C", "D", "dh_dt", "dX_dt")


def _limit_faults(law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    faults = []
    allowed = set(known.values()) - {a}
    for limit in law.limits:
        where = f"limit {limit.name!r}"
        faults += [f"{where}: {fault}" for fault in _order_faults(limit, law, known)]
        for quantity, form in limit.claims.items():
            if quantity not in CLAIMABLE:
                near = get_close_matches(quantity, CLAIMABLE, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                faults.append(f"{where}: cannot claim {quantity!r}; one can claim {', '.join(CLAIMABLE)}{hint}")
                continue
            if not isinstance(form, Expr):
                faults.append(f"{where}, {quantity}: {form!r} is not a sympy expression")
                continue
            faults += node_faults(f"{where}, {quantity}", form)
            strange = sorted(str(symbol) for symbol in form.free_symbols - allowed)
            if strange:
                faults.append(f"{where}, {quantity}: unknown symbol {', '.join(strange)}")
        faults += [f"{where}: {fault}" for fault in _within_faults(limit, allowed)]
    return faults


def _within_faults(limit: Limit, allowed: set[Symbol]) -> list[str]:
    """An error belongs to a claim, and holds where ratios, independent of one another, are small."""
    faults = [f"within: {quantity!r} is not claimed" for quantity in limit.within if quantity not in limit.claims]
    faults += [f"within: {error} is no error between 0 and 1" for error in limit.within.values() if not 0 < error < 1]
    faults += [
        f"where: {ratio!r} must be a ratio, such as h/R, and below a positive number"
        for ratio, bound in limit.where.items()
        if not (isinstance(ratio, Expr) and is_monomial(ratio) and ratio.free_symbols <= allowed - {F} and bound > 0)
    ]
    return faults


def chains(limit: Limit) -> tuple[tuple[Expr, ...], ...]:
    """Return the orderings of a limit, one or several, each from the smallest to the largest."""
    order = limit.order
    several = isinstance(order, tuple) and order and isinstance(order[0], tuple)
    return order if several else (order,)


def _order_faults(limit: Limit, law: ContactLaw, known: Mapping[str, Symbol]) -> list[str]:
    """An ordering holds sizes that can be compared, h or delta among them."""
    order = limit.order
    whole = all(isinstance(chain, tuple) and len(chain) >= 2 for chain in chains(limit))
    lengths = [length for chain in chains(limit) for length in chain] if whole else []
    allowed = set(known.values()) - {a}
    strange = [x for x in lengths if not (isinstance(x, Expr) and _is_size(x) and x.free_symbols <= allowed)]
    if strange or not whole:
        return [
            f"order must hold sizes, from smallest to largest, such as (h, delta, R), not {strange or order}: products "
            "of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms"
        ]
    size, pressed = Symbol("delta", positive=True), Symbol("F", positive=True)
    sides = ({delta: sign * size, F: sign * pressed} for sign in (1, -1))
    # a logarithm is positive where it stands, by being ordered
    sizes = [x.xreplace({part: Dummy("log", positive=True) for part in x.atoms(log)}) for x in lengths]
    if not any(all(x.subs(side).is_positive for x in sizes) for side in sides):
        return [f"order holds sizes, which are positive on one side, of compression or tension; {order} is not"]
    if not any(length.has(h, delta, F) for length in lengths):
        return [f"order must say how h and delta compare, as in (h, delta, R); {order} does not"]
    faults = []
    for chain in chains(limit):
        found = {str(dimension_of(length, {**DIMENSIONS, **law.parameters})) for length in chain}
        if len(found) > 1:
            faults.append(f"order compares {' with '.join(sorted(found))} in {chain}")
    return faults


def _is_size(expr: Expr) -> bool:
    """Whether an expression is a product of powers of symbols, and of exponentials and logarithms of such products."""
    factors = [factor for factor in Mul.make_args(expr) if not isinstance(factor, exp)]
    rates = [term for factor in expr.atoms(exp) for term in Add.make_args(factor.args[0])]
    inner = [function.args[0] for function in expr.atoms(log)]
    plain = Mul(*factors).xreplace({function: Dummy("log", positive=True) for function in expr.atoms(log)})
    return all(map(is_monomial, (plain, *rates, *inner)))


def is_monomial(expr: Expr) -> bool:
    """Whether an expression is a number times rational powers of symbols."""
    powers = expr.as_powers_dict()
    return all(base.is_Symbol or base.is_number for base in powers) and all(p.is_Rational for p in powers.values())


def _typical_faults(law: ContactLaw) -> list[str]:
    from softdyn.derive.law import ranges_of

    faults = []
    sound = ranges_of(law) if all(map(is_range, law.ranges.values())) else {}
    for symbol, value in law.typical.items():
        if symbol not in law.parameters:
            faults.append(f"typical: {symbol} is not among the law's own parameters")
            continue
        number = sympify_number(value)
        if number is None:
            faults.append(f"typical: {symbol} = {value} must be an exact number times powers of R, E and eta")
            continue
        found = dimension_of(value, DIMENSIONS) if isinstance(value, Expr) else None
        expected = law.parameters[symbol]
        if isinstance(value, Expr) and found is not None and found != expected and value.free_symbols:
            faults.append(f"typical: {symbol} = {value} has the dimension {found}; {expected} is expected")
        if (symbol.is_positive and not number > 0) or (symbol in sound and number not in sound[symbol]):
            faults.append(f"typical: {symbol} = {value} lies outside its range")
        elif number == 0:
            faults.append(
                f"typical: {symbol} = 0 has no order of magnitude; leave it out, or give a number that is small"
            )
    return faults


def sympify_number(value: object) -> Rational | None:
    """Return an exact number times powers of R, E and eta, in units of these; None if it is nothing of the kind."""
    if isinstance(value, int):
        return Rational(value)
    if not isinstance(value, Expr) or not is_monomial(value) or value.free_symbols - set(COMMON_PARAMETERS):
        return None
    number = value.subs(dict.fromkeys(COMMON_PARAMETERS, 1))
    return number if isinstance(number, Rational) else None


def _one_sided_faults(law: ContactLaw) -> list[str]:
    """Rigid particles have no deflection, a dry contact has no gap, and there is a force that can be derived."""
    rigid, dry = law.F_ela == oo, law.zeta == 0
    faults = []
    if rigid and dry:
        faults.append("F_ela = oo and zeta = 0 leave nothing that moves")
    if rigid and law.a.has(delta):
        faults.append(f"F_ela = oo declares rigid particles, delta = 0: a = {law.a} must not depend on delta")
    if dry and law.a.has(h):
        faults.append(f"zeta = 0 declares a dry contact, h = 0: a = {law.a} must not depend on h")
    if rigid and law.F_adh.has(delta):
        faults.append(f"F_ela = oo declares rigid particles, delta = 0: F_adh = {law.F_adh} must not depend on delta")
    if dry and law.F_ela.has(h):
        faults.append(f"zeta = 0 declares a dry contact, h = 0: F_ela = {law.F_ela} must not depend on h")
    without = (("F_ela = oo", rigid, ("delta", "C", "F", "F_ela")), ("zeta = 0", dry, ("zeta", "D", "dh_dt", "dX_dt")))
    faults += [
        f"limit {limit.name!r}: a law with {what} has no {quantity}"
        for what, holds, absent in without
        for limit in law.limits
        for quantity in limit.claims
        if holds and quantity in absent
    ]
    return faults


def _origin_faults(law: ContactLaw) -> list[str]:
    """No deflection, no elastic force: what delta means, and what bounds the solution of the force balance.

    A general law may have a force there, as that of JKR has, if it is finite and the law has no kink at delta = 0: no
    step of an integration would end where the deflection passes that.
    """
    if law.F_ela == oo:
        return []
    at_rest = law.F_ela.subs(delta, 0)
    if at_rest == 0:
        return []
    if not law.general:
        return [
            f"F_ela must vanish at delta = 0, where it is {at_rest}; a law with a force at delta = 0, as that of JKR, "
            "is declared with general=True"
        ]
    if law.zeta == 0:
        return [
            f"zeta = 0 declares a dry contact: F_ela must vanish at delta = 0, where it is {at_rest}; a contact that "
            "is made and broken at different distances is not known yet"
        ]
    if at_rest.has(oo, -oo, zoo, nan):
        return [f"F_ela must be finite at delta = 0, where it is {at_rest}"]
    kinks = sorted({str(node) for name in SIGNATURES for node in _of_side(getattr(law, name))})
    return [
        f"F_ela is {at_rest} at delta = 0: {kink} has a kink there, and the deflection passes it at any force; write "
        "the law smooth in delta, or with F_ela = 0 at delta = 0"
        for kink in kinks
    ]


def _of_side(expr: Expr) -> list[Basic]:
    """Parts that have a kink or a jump at delta = 0."""
    nodes = expr.atoms(Abs, sign, Max, Min, Relational)
    # the size of what is never 0 at delta = 0 has none
    return [
        node for node in nodes if node.has(delta) and not (isinstance(node, Abs) and node.args[0].subs(delta, 0) != 0)
    ]


@dataclass(frozen=True)
class Sign:
    """What is known of the sign of a quantity of a law on one side of delta = 0."""

    quantity: str
    expression: Expr
    side: str
    found: Positivity


@lru_cache(maxsize=16)
def signs_of(law: ContactLaw) -> tuple[Sign, ...]:
    """Whether radius, stiffness and friction are positive for h > 0, abs(delta) < R, on each side of delta = 0.

    At delta = 0 itself the stiffness may vanish, as Hertz's does, or have no bound: there is no force then.
    """
    return tuple(_signs_of(law))


@lru_cache(maxsize=16)
def rubbing_signs_of(law: ContactLaw) -> tuple[Sign, ...]:
    """Whether what a law declares of surfaces that rub is not negative, on each side of delta = 0.

    The coefficient of friction matters where there is a load: theirs is the product that is looked at.
    """
    if law.rubbing is None:
        return ()
    load = law.rubbing.load
    quantities = {"rubbing load": load, "rubbing k_t": law.rubbing.k_t, "rubbing mu load": law.rubbing.mu * load}
    if law.rubbing.mu == 1:
        del quantities["rubbing mu load"]
    sides = {"delta > 0": 1}
    if law.zeta != 0 and law.F_ela != oo and not pressed_only(law):
        sides |= {"delta < 0": -1, "delta = 0": 0}
    domain = (*_domain_of(law), (slip_rate, ranges_of_symbol(slip_rate, None)))
    found = []
    for name, quantity in quantities.items():
        explicit = quantity.subs(a, law.a)
        for words, value in sides.items() if explicit.has(delta) else [("any delta", 0)]:
            expr = tidy(explicit.subs(delta, value * _SIZE)).subs({R: 1, E: 1, eta: 1})
            found.append(Sign(name, quantity, words, not_negative(expr, domain)))
    return tuple(found)


def undecided_signs(law: ContactLaw) -> list[str]:
    """Words for each sign that is not proved: where it is not known."""
    sides: dict[tuple[str, str], list[str]] = {}
    quantities = [(f"{sign_.quantity} > 0", sign_) for sign_ in signs_of(law)]
    quantities += [(f"{sign_.quantity} >= 0", sign_) for sign_ in rubbing_signs_of(law)]
    for quantity, sign_ in quantities:
        if sign_.found.verdict == "unknown":
            sides.setdefault((quantity, box_words(sign_)), []).append(sign_.side)
    return [
        f"{quantity} is not proved for {', '.join(where)}, at {box}; a run there may go wrong"
        for (quantity, box), where in sides.items()
    ]


def box_words(sign_: Sign) -> str:
    """The box in which a sign is not known, in words."""
    flip = -1 if sign_.side == "delta < 0" else 1
    sides = [
        (name, sorted((flip * low, flip * high)) if name == "delta" else (low, high))
        for name, (low, high) in sign_.found.left.items()
    ]
    words = [
        f"{name} near {low:.6g}" if f"{low:.6g}" == f"{high:.6g}" else f"{low:.6g} < {name} < {high:.6g}"
        for name, (low, high) in sides
    ]
    return ", ".join(words) + " (R = E = eta = 1)"


def _signs_of(law: ContactLaw) -> Iterator[Sign]:
    from softdyn.derive.dynamics import stiffness_of

    quantities = {"a": law.a}
    if law.F_ela != oo:
        quantities["C"] = stiffness_of(law)
    if law.zeta != 0:
        quantities["zeta"] = law.zeta
    for name, quantity in quantities.items():
        explicit = quantity.subs(a, law.a)
        sides = {"delta > 0": 1, "delta < 0": -1, "delta = 0": 0}
        for words, value in sides.items():
            if value == 0 and (name == "C" or law.zeta == 0):
                continue  # spheres that just touch, dry, have no contact area
            if value == 0 and not explicit.has(delta):
                continue
            if value < 0 and (law.zeta == 0 or pressed_only(law)):
                continue  # surfaces that do not touch are not deflected, dry
            expr = tidy(explicit.subs(delta, value * _SIZE))
            yield Sign(name, quantity, words, sign_on_domain(expr, law))


def _positivity_faults(law: ContactLaw) -> list[str]:
    """Radius, stiffness and friction must be positive; a witness shows where they are not."""
    faults: dict[str, str] = {}
    for sign_ in signs_of(law):
        if sign_.found.verdict == "witness" and sign_.quantity not in faults:
            # what the sign does not depend on may be anything
            anywhere = {"h": mpmath.mpf(1), **({} if sign_.side == "delta = 0" else {"delta": mpmath.mpf(10) ** -3})}
            found = replace(sign_.found, at={**anywhere, **sign_.found.at})
            point = _point(found, -1 if sign_.side == "delta < 0" else 1)
            faults[sign_.quantity] = (
                f"{sign_.quantity} must be positive for h > 0 and |delta| < R, but at {point} ({sign_.side}) it is "
                f"{mpmath.nstr(sign_.found.value, 6)}; {sign_.quantity} = {sign_.expression}"
            )
    return list(faults.values())


def _rubbing_sign_faults(law: ContactLaw) -> list[str]:
    """Load, stiffness and bound of surfaces that rub are nowhere negative; a witness shows where they are."""
    faults: dict[str, str] = {}
    for sign_ in rubbing_signs_of(law):
        if sign_.found.verdict == "witness" and sign_.quantity not in faults:
            point = _point(sign_.found, -1 if sign_.side == "delta < 0" else 1)
            faults[sign_.quantity] = (
                f"{sign_.quantity} must not be negative for h > 0 and |delta| < R, but at {point} ({sign_.side}) it is "
                f"{mpmath.nstr(sign_.found.value, 6)}; {sign_.quantity.removeprefix('rubbing ')} = {sign_.expression}"
            )
    return list(faults.values())


@lru_cache(maxsize=64)
def pressed_only(law: ContactLaw) -> bool:
    """Whether a law says nothing of surfaces that are pulled: its elastic force, or radius, is no real number there."""
    from softdyn.derive.law import sample_values

    if law.F_ela == oo:
        return False
    at = {**sample_values(law), R: 1, E: 1, eta: 1}
    deflections = [-Rational(1, 10**6), -Rational(1, 1000), -Rational(1, 10), -Rational(1, 2)]
    for quantity in (law.a, law.F_ela.subs(a, law.a)):
        values = [quantity.subs({**at, h: Rational(1, 10), delta: deflection}).evalf() for deflection in deflections]
        if all(value.is_real is False for value in values):
            return True
    return False


def sign_on_domain(expr: Expr, law: ContactLaw) -> Positivity:
    """Whether an expression is positive for h > 0, abs(delta) < R, and all own parameters allowed."""
    return positivity(expr.subs({R: 1, E: 1, eta: 1}), _domain_of(law))


def _domain_of(law: ContactLaw) -> Domain:
    """Of each symbol, R, E and eta being 1."""
    from softdyn.derive.law import ranges_of

    allowed = ranges_of(law)
    own = [(symbol, ranges_of_symbol(symbol, allowed.get(symbol))) for symbol in law.parameters]
    return ((h, ranges_of_positive("h")), (_SIZE, ranges_of_positive(_SIZE.name, Rational(1))), *own)


def _witness_of_part(expr: Expr, law: ContactLaw) -> Positivity | None:
    """Where an expression of particles of any two sizes is not positive; None if that is not seen.

    These are looked at in points: 11 gaps, 8 deflections, some size ratios and values of the law's own parameters.
    """
    for ratio in RATIOS if expr.has(size_ratio) else (None,):
        value = tidy(expr if ratio is None else expr.subs(size_ratio, ratio))
        own = tuple((symbol, _samples(symbol, law)) for symbol in law.parameters if symbol in value.free_symbols)
        found = _witness_in_points(value, own)
        if found is not None:
            size_of = {} if ratio is None else {"size_ratio": mpmath.mpf(int(ratio.p)) / int(ratio.q)}
            return replace(found, at={**size_of, **found.at})
    return None


@lru_cache(maxsize=256)
def _witness_in_points(expr: Expr, own: tuple[tuple[Symbol, tuple[mpmath.mpf, ...]], ...]) -> Positivity | None:
    """Laws that are built on one another have expressions in common: each is looked at once."""
    if expr.is_positive or (rewritable(expr) and expr.factor().is_positive):
        return None
    free = [(symbol, powers) for symbol, powers in ((h, GAPS), (_SIZE, DEFLECTIONS)) if symbol in expr.free_symbols]
    variables = [symbol for symbol, _ in (*free, *own)]
    function = lambdify(variables, expr.subs({R: 1, E: 1, eta: 1}), modules="mpmath", dummify=True)
    with mpmath.workdps(40):
        samples = [[mpmath.mpf(10) ** k for k in powers] for _, powers in free]
        for point in product(product(*samples), _combinations([values for _, values in own])):
            numbers = [*point[0], *point[1]]
            try:
                found = function(*numbers)
            except (ZeroDivisionError, ValueError, OverflowError):
                continue
            if mpmath.im(found) != 0 or not mpmath.re(found) > 0:
                return Positivity(
                    "witness", {symbol.name: number for symbol, number in zip(variables, numbers, strict=True)}, found
                )
    return None


def _combinations(samples: Sequence[tuple[mpmath.mpf, ...]]) -> list[tuple[mpmath.mpf, ...]]:
    """Values of the parameters, in which one at most differs from the middle ones."""
    middle = tuple(values[len(values) // 2] for values in samples)
    varied = ((*middle[:k], value, *middle[k + 1 :]) for k, values in enumerate(samples) for value in values)
    return list(dict.fromkeys([middle, *varied]))


def _point(found: Positivity, side: int = 1) -> str:
    """A witness in words."""
    numbers = {name: side * number if name == "delta" else number for name, number in found.at.items()}
    shown = ", ".join(f"{name}={_short(number)}" for name, number in numbers.items())
    return f"{shown} (R = E = eta = 1)" if shown else "R = E = eta = 1"


def _short(number: mpmath.mpf) -> str:
    """A number to as few digits as it has."""
    few = str(mpmath.nstr(number, 3))
    return few if abs(mpmath.mpf(few) - number) <= abs(number) * 1e-15 else str(mpmath.nstr(number, 17))


def _samples(symbol: Symbol, law: ContactLaw) -> tuple[mpmath.mpf, ...]:
    from softdyn.derive.law import ranges_of

    allowed = ranges_of(law).get(symbol)
    if allowed is not None:
        low, high = (mpmath.mpf(exact.p) / exact.q for exact in (Rational(allowed.start), Rational(allowed.end)))
        parts = (0 if not allowed.left_open else 1, 5, 10 if not allowed.right_open else 9)
        samples = [low + (high - low) * mpmath.mpf(part) / 10 for part in parts]
        return tuple(sample for sample in samples if sample > 0 or not symbol.is_positive)
    positive = tuple(mpmath.mpf(10) ** k for k in (-3, 0, 3))
    return positive if symbol.is_positive else (-positive[1], positive[0], positive[1])
