"""From sympy expressions to straight-line code.

The code is a small subset of Python that every target understands: assignments of floats, arithmetic, comparisons,
conditional expressions and the functions of C's math.h. Common subexpressions are computed once, integer powers are
products, halves and quarters of them are square roots, and numbers are exact until they are printed.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from functools import lru_cache

from sympy import (
    Add,
    Basic,
    Expr,
    Integer,
    Max,
    Min,
    Mul,
    Piecewise,
    Pow,
    Rational,
    S,
    Symbol,
    cse,
    exp,
    numbered_symbols,
    sign,
)
from sympy.core.relational import Relational
from sympy.logic.boolalg import And, Not, Or

from softdyn.derive.special import NAMES as SPECIAL
from softdyn.derive.splines import Spline, kernel_name

Assignment = tuple[str, str]

#: sympy's names of functions, where math.h calls them otherwise.
RENAMED = {"Abs": "fabs"} | SPECIAL
MATH_FUNCTIONS = frozenset(
    "sqrt fabs exp log expm1 log1p pow sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh erf erfc".split()
)


def straight_line(targets: Iterable[Symbol], definitions: Mapping[Symbol, Expr]) -> list[Assignment]:
    """Assignments, in order, that compute the targets and whatever they need.

    Parameters
    ----------
    targets : symbols wanted
    definitions : mapping from Symbol to Expr
        Each in terms of earlier ones and of symbols that the code around provides.

    Returns
    -------
    list of (name, expression), both text
    """
    needed = _closure(set(targets), definitions)
    taken = {symbol for expr in needed.values() for symbol in expr.free_symbols} | set(needed)
    fresh = numbered_symbols("x", exclude=taken, real=True)
    shared, reduced = cse(list(needed.values()), symbols=fresh, order="canonical")
    # the powers of a name get names of their own below, and conditions are no numbers: both go back where they were
    inlined: dict[Symbol, Basic] = {}
    pool: dict[Symbol, Expr] = {}
    for name, expr in shared:
        back = expr.xreplace(inlined)
        kept = inlined if _is_integer_power(back) or not isinstance(back, Expr) else pool
        kept[name] = back
    pool |= {name: expr.xreplace(inlined) for name, expr in zip(needed, reduced, strict=True)}
    pool = _name_bases(pool, fresh)
    return _print_in_order(pool, list(needed))


def _by_roots(power: Expr) -> bool:
    """Whether a power is a product of integer powers and square roots, at most one within another."""
    return isinstance(power, Rational) and power.q in (1, 2, 4)


#: Powers, but for their sign, whose text holds the base once.
_BASE_ONCE = (Rational(1, 4), Rational(1, 2), S.One)


def _is_integer_power(expr: Basic) -> bool:
    return isinstance(expr, Pow) and expr.base.is_Symbol and isinstance(expr.exp, Integer) and expr.exp > 1


def _closure(targets: set[Symbol], definitions: Mapping[Symbol, Expr]) -> dict[Symbol, Expr]:
    wanted = set(targets)
    for symbol in reversed(definitions):
        if symbol in wanted:
            wanted |= definitions[symbol].free_symbols
    return {symbol: expr for symbol, expr in definitions.items() if symbol in wanted}


def _name_bases(pool: dict[Symbol, Expr], fresh: Iterable[Symbol]) -> dict[Symbol, Expr]:
    """Give a name to every composite base that the text of its power repeats, so that the text repeats the name."""
    named: dict[Expr, Symbol] = {}

    def visit(expr: Expr) -> Expr:
        if not expr.args:
            return expr
        expr = expr.func(*(visit(argument) for argument in expr.args))
        if isinstance(expr, Pow) and _by_roots(expr.exp) and abs(expr.exp) not in _BASE_ONCE and expr.base.args:
            base = expr.base
            if base not in named:
                named[base] = next(iter(fresh))
            return Pow(named[base], expr.exp)
        return expr

    visited = {symbol: visit(expr) for symbol, expr in pool.items()}
    return {**{symbol: base for base, symbol in named.items()}, **visited}


def _print_in_order(pool: dict[Symbol, Expr], order: list[Symbol]) -> list[Assignment]:
    """Print each definition after those that it uses, and the powers of a name right before their first use."""
    lines: list[Assignment] = []
    done: set[Symbol] = set()
    powers: set[tuple[str, int]] = set()

    def emit(symbol: Symbol) -> None:
        if symbol in done:
            return
        done.add(symbol)
        for used in sorted(pool[symbol].free_symbols & set(pool), key=lambda s: list(pool).index(s)):
            emit(used)
        for base, exponent in _integer_powers(pool[symbol]):
            emit_power(base, exponent)
        lines.append((symbol.name, print_expression(pool[symbol])))

    def emit_power(base: str, exponent: int) -> None:
        if exponent == 1 or (base, exponent) in powers:
            return
        low, high = exponent // 2, exponent - exponent // 2
        emit_power(base, low)
        emit_power(base, high)
        powers.add((base, exponent))
        lines.append((power_name(base, exponent), f"{power_name(base, high)} * {power_name(base, low)}"))

    for symbol in order:
        emit(symbol)
    return lines


def power_name(base: str, exponent: int) -> str:
    """Return the name of the variable that holds an integer power."""
    return base if exponent == 1 else f"{base}_p{exponent}"


def _integer_powers(expr: Expr) -> list[tuple[str, int]]:
    """Integer parts, above 1, of the powers of names in an expression."""
    found = {
        (node.base.name, int(abs(node.exp)))
        for node in expr.atoms(Pow)
        if node.base.is_Symbol and _by_roots(node.exp)
        if abs(node.exp) >= 2
    }
    return sorted(found)


# Precedences of the printed text.
_SUM, _PRODUCT, _UNARY, _ATOM = range(4)


def print_expression(expr: Expr) -> str:
    """Text of one expression; integer powers of names appear as the names of :func:`power_name`."""
    return _text(expr)[0]


def _text(expr: Expr) -> tuple[str, int]:
    if isinstance(expr, Symbol):
        return expr.name, _ATOM
    if isinstance(expr, Rational):
        return _number(expr)
    if expr.is_number and not expr.has(Piecewise):
        value = float(expr.evalf(30))
        return repr(value), _ATOM if value >= 0 else _UNARY
    if isinstance(expr, Add):
        return _sum(expr), _SUM
    if isinstance(expr, (Mul, Pow)):
        return _product(expr)
    if isinstance(expr, sign):
        argument = _text(expr.args[0])[0]
        return f"(1.0 if {argument} > 0.0 else (-1.0 if {argument} < 0.0 else 0.0))", _ATOM
    if isinstance(expr, (Min, Max)):
        order = "<" if isinstance(expr, Min) else ">"
        first, *rest = (_text(argument)[0] for argument in expr.args)
        for other in rest:
            first = f"({first} if {first} {order} {other} else {other})"
        return first, _ATOM
    if isinstance(expr, Piecewise):
        return _piecewise(expr), _ATOM
    if isinstance(expr, (Relational, And, Or, Not)):
        return _condition(expr), _ATOM
    if isinstance(expr, Spline):
        return f"{kernel_name(expr)}({_text(expr.args[0])[0]})", _ATOM
    name = type(expr).__name__
    name = RENAMED.get(name, name)
    if name not in MATH_FUNCTIONS and name not in SPECIAL.values():
        raise ValueError(f"no target can print {expr}")
    return f"{name}({', '.join(_text(argument)[0] for argument in expr.args)})", _ATOM


def _number(value: Rational) -> tuple[str, int]:
    """A decimal literal where the number is one, else a quotient, which compilers fold; both round correctly."""
    if value.q == 1 and abs(value.p) < 2**53:
        text = f"{value.p}.0"
    elif abs(value.p) < 2**53 and value.q < 2**53 and float(value) != 0:
        exact = Rational(repr(float(value))) == value
        text = repr(float(value)) if exact else f"({value.p}.0 / {value.q}.0)"
        return (text, _ATOM) if value > 0 or not exact else (text, _UNARY)
    else:
        text = repr(float(value))
    return text, _ATOM if value >= 0 else _UNARY


def _wrapped(expr: Expr, precedence: int) -> str:
    text, own = _text(expr)
    return text if own >= precedence else f"({text})"


def _sum(expr: Add) -> str:
    terms = expr.as_ordered_terms()
    # a sum reads better, and needs no unary minus, if it starts with a positive term
    terms.sort(key=lambda term: bool(term.could_extract_minus_sign()))
    text = _wrapped(terms[0], _SUM)
    for term in terms[1:]:
        if term.could_extract_minus_sign():
            text += f" - {_wrapped(-term, _PRODUCT)}"
        else:
            text += f" + {_wrapped(term, _PRODUCT)}"
    return text


def _product(expr: Expr) -> tuple[str, int]:
    """One fraction: constant first, then names, then roots gathered under one sqrt."""
    number: Expr = S.One
    above: list[str] = []
    below: list[str] = []
    root_above: list[Expr] = []
    root_below: list[Expr] = []
    for factor in Mul.make_args(expr):
        # exp(x) is a function here, not the power that sympy takes it for
        base, power = (factor, S.One) if isinstance(factor, exp) else factor.as_base_exp()
        if factor.is_number and getattr(power, "q", 1) != 2:
            number *= factor
        elif _by_roots(power):
            whole, rest = divmod(abs(power), 1)
            over, under = (above, root_above) if power > 0 else (below, root_below)
            if whole:
                over.append(_integer_power(base, int(whole)))
            if rest:
                under.append(base ** (2 * rest))  # a quarter is a root within a root
        else:
            above.append(_general_power(base, power))
    if number.is_Rational and number.q != 1 and number.p in (1, -1) and (above or root_above):
        below.insert(0, _number(Rational(number.q))[0])  # x/2, not 0.5 x: exact either way, and reads as the paper
        number = Rational(number.p)
    negative = number.is_negative
    number = abs(number)
    above += _joint_root(root_above)
    below += _joint_root(root_below)
    if number != 1 or not above:
        above.insert(0, _wrapped(number, _PRODUCT))
    text = " * ".join(above)
    if below:
        text += f" / {below[0]}" if len(below) == 1 else f" / ({' * '.join(below)})"
    return (f"-{text}", _UNARY) if negative else (text, _PRODUCT)


def _joint_root(bases: list[Expr]) -> list[str]:
    if not bases:
        return []
    only = len(bases) == 1
    return [f"sqrt({' * '.join(_wrapped(base, _SUM if only else _PRODUCT) for base in bases)})"]


def _integer_power(base: Expr, power: int) -> str:
    if power == 1 or not base.is_Symbol:
        assert power == 1, f"{base}**{power} should have a name"
        return _wrapped(base, _UNARY)
    return power_name(base.name, power)


def _general_power(base: Expr, power: Expr) -> str:
    return f"pow({_text(base)[0]}, {_text(power)[0]})"


def _piecewise(expr: Piecewise) -> str:
    *branches, (last, condition) = expr.args
    text = _wrapped(last, _SUM) if condition == True else "nan"  # noqa: E712 - a sympy truth value
    if condition != True:  # noqa: E712
        branches.append((last, condition))
    for value, condition in reversed(branches):
        text = f"({_text(value)[0]} if {_condition(condition)} else {text})"
    return text


def _condition(condition: Expr) -> str:
    if isinstance(condition, And):
        return "(" + " and ".join(_condition(part) for part in condition.args) + ")"
    if isinstance(condition, Or):
        return "(" + " or ".join(_condition(part) for part in condition.args) + ")"
    if isinstance(condition, Not):
        return f"(not {_condition(condition.args[0])})"
    return f"{_wrapped(condition.lhs, _SUM)} {condition.rel_op} {_wrapped(condition.rhs, _SUM)}"


KINDS = ("add", "mul", "div", "sqrt", "call")


def operations(lines: Iterable[Assignment]) -> dict[str, int]:
    """Count the floating-point operations of straight-line code, by kind; constants that a compiler folds are free."""
    counts = [_operations_of(text) for _, text in lines]
    return {kind: sum(count[i] for count in counts) for i, kind in enumerate(KINDS)}


@lru_cache(maxsize=4096)
def _operations_of(text: str) -> tuple[int, ...]:
    counts = dict.fromkeys(KINDS, 0)
    for node in ast.walk(ast.parse(text, mode="eval")):
        if isinstance(node, ast.BinOp) and not (_constant(node.left) and _constant(node.right)):
            kind = {ast.Add: "add", ast.Sub: "add", ast.Mult: "mul", ast.Div: "div"}[type(node.op)]
            counts[kind] += 1
        elif isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            counts["sqrt" if name == "sqrt" else "call"] += name != "fabs"
    return tuple(counts[kind] for kind in KINDS)


def _constant(node: ast.AST) -> bool:
    if isinstance(node, ast.UnaryOp):
        return _constant(node.operand)
    if isinstance(node, ast.BinOp):
        return _constant(node.left) and _constant(node.right)
    return isinstance(node, ast.Constant)
