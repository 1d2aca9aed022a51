"""An independent check of certificates of limits: exact fractions, its own reading of expressions.

A certificate says that quantity/claim tends to 1 as every inequality of an order sharpens, at whatever rates. It holds,
in JSON, expressions in prefix notation, as ``["^", "h", "1/2"]``, of + * ^ exp log and expm1, numbers, pi and positive
names, and a tree of cases.

Along any sequence on which each ratio large/small of the order grows without bound, a monomial that a case splits at
has a subsequence on which it tends to oo ("above"), to 0 ("below"), or stays between two positive numbers ("level"): no
case is left out. In each, every sum that is met is led by some of its terms. That one is small against another is shown
by multipliers (Farkas): ln of their quotient is a sum of logarithms that are known to grow, with multipliers >= 0, and
of such that stay bounded. What leads then has the same coefficients, exactly, in the quantity and in the claim.
Exponentials that vanish and logarithms that grow are further variables ("atoms"), whose relation to their argument is
checked. What is fixed and "assumed" to be positive is shown beside the claim. "branches" of a law apply where the order
tells that one side of their condition is small; "forces" compare a quantity, once it is defined.
"""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import product
from typing import Any

FORMAT = "softdyn certificate 1"
#: ln of a monomial, by variable; a term is a monomial, and a value its leading terms with their coefficients.
Vector = dict[str, Fraction]
Monomial = tuple[tuple[str, Fraction], ...]
Value = dict[Monomial, Fraction]
ONE: Monomial = ()
MOST_TERMS, LARGEST_PRIME, MOST_DEPTH = 64, 10_000, 60


class Refused(ValueError):
    """What is wrong with a certificate."""


class Missing(Refused):
    """No multipliers are given that compare two terms."""

    def __init__(self, quotients: list[Vector], case: Case) -> None:
        super().__init__(f"no multipliers show which is larger: {[shown(q) for q in quotients]}")
        self.quotients, self.case = quotients, case


class Case:
    """What is known in one case: logarithms that grow, and such that stay bounded; and the multipliers given."""

    def __init__(self, grow: list[Vector], bounded: list[Vector], given: Any) -> None:
        self.grow, self.bounded, self.given = grow, bounded, given
        self.names: dict[str, str] = {}
        self.assumed: set[str] = set()
        self.values: dict[str, Value] = {}

    def grows(self, quotient: Vector) -> bool:
        """Whether multipliers show that ln of a quotient grows without bound."""
        return any(self._adds_up(entry, quotient, True) for entry in self.given.get(shown(quotient), ()))

    def stays(self, quotient: Vector) -> bool:
        """Whether ln of a quotient stays bounded."""
        return not quotient or any(self._adds_up(e, quotient, False) for e in self.given.get(shown(quotient), ()))

    def _adds_up(self, entry: Any, quotient: Vector, growing: bool) -> bool:
        by, level = [[number(x) for x in part] for part in entry]
        if len(by) > len(self.grow) or len(level) > len(self.bounded) or any(x < 0 for x in by):
            return False
        if growing != any(x > 0 for x in by):
            return False
        total: Vector = {}
        for factor, vector in [*zip(by, self.grow, strict=False), *zip(level, self.bounded, strict=False)]:
            total = plus(total, vector, factor)
        return total == quotient


def check_certificate(certificate: Any) -> None:
    """Check a certificate, as read from JSON; Refused, if it is, names what does not hold."""
    try:
        if certificate["format"] != FORMAT:
            raise Refused(f"format {certificate['format']!r}, not {FORMAT!r}")
        given = certificate["multipliers"]
        ordered = json.dumps([certificate["order"], certificate.get("forces", [])])
        for name in certificate["fixed"]:
            if name not in ("R", "E", "eta") and json.dumps(name) in ordered:
                raise Refused(f"{name} is not fixed: the order compares it")
        visit(certificate, certificate["cases"], [], [{name: Fraction(1)} for name in certificate["fixed"]], given, 0)
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError, StopIteration) as e:
        raise e if isinstance(e, Refused) else Refused(f"malformed: {e!r}") from None


def visit(data: Any, node: Any, above: list[Vector], level: list[Vector], given: Any, depth: int) -> None:
    """Check a case, or those that it is split into."""
    if depth > MOST_DEPTH:
        raise Refused("too many cases")
    if node != "leaf":
        at = {str(name): number(x) for name, x in node["split"].items() if number(x)}
        if not at:
            raise Refused("a case is split at 1")
        visit(data, node["above"], [*above, at], level, given, depth + 1)
        visit(data, node["below"], [*above, plus({}, at, Fraction(-1))], level, given, depth + 1)
        visit(data, node["level"], above, [*level, at], given, depth + 1)
        return
    case = Case([], list(level), given)
    case.assumed = {json.dumps(expression) for expression in data["assumed"]}
    if any(not names_in(json.loads(text)) <= {"pi", *data["fixed"]} for text in case.assumed):
        raise Refused("only what is fixed can be assumed to be positive")
    for name, expression, _ in data["atoms"]:
        if not str(name).startswith("~") or name in case.names.values():
            raise Refused(f"{name!r} cannot name an atom")
        case.names[json.dumps(expression)] = name
    for small, large in data["order"]:
        case.grow.append(ratio(small, large, case))
    case.grow += above
    if case.grows({}):  # 1 would grow: nothing belongs to this case
        return
    for name, (kind, argument), exponent in data["atoms"]:
        require_atom(name, kind, argument, number(exponent), case)
        if case.grows({}):
            return
    for small, large in data.get("branches", []):
        require_growth(ratio(small, large, case), case)
    for name, expression in data["definitions"]:
        if name in case.values:
            raise Refused(f"{name!r} is defined twice")
        case.values[name] = value_of(expression, case)
        case.grow += [ratio(small, large, case) for last, small, large in data.get("forces", []) if last == name]
        if case.grows({}):
            return
    found, claimed = value_of(data["quantity"], case), value_of(data["claim"], case)
    if found != claimed or not found:
        raise Refused(f"the quantity is led by {written(found)}, the claim by {written(claimed)}")


def ratio(small: Any, large: Any, case: Case) -> Vector:
    """Logarithm of large/small, two products of powers."""
    below, over = value_of(small, case), value_of(large, case)
    if len(below) != 1 or len(over) != 1:
        raise Refused("an order compares products of powers")
    return plus(vector_of(*over), vector_of(*below), Fraction(-1))


def require_growth(quotient: Vector, case: Case) -> None:
    if not case.grows(quotient):
        raise Missing([quotient], case)


def require_atom(name: str, kind: str, argument: Any, exponent: Fraction, case: Case) -> None:
    """An exponential that vanishes is small against any power of its argument; a logarithm grows, slower than any."""
    value = value_of(argument, case)
    vector = vector_of(next(iter(value)))
    sign = 1 if kind == "log" else -1
    if exponent <= 0 or kind not in ("exp", "log") or any(sign * c <= 0 for c in value.values()):
        raise Refused(f"{name} is no exponential that vanishes, nor a logarithm that grows")
    require_growth(vector, case)
    against = plus({}, vector, exponent * sign)
    case.grow += [{name: Fraction(sign)}, plus(against, {name: Fraction(1)}, Fraction(-1))]


def value_of(expression: Any, case: Case) -> Value:
    """Leading terms of an expression in a case."""
    name = case.names.get(json.dumps(expression))
    if name is not None:
        return {((name, Fraction(1)),): Fraction(1)}
    if isinstance(expression, str):
        if expression in case.values:
            return case.values[expression]
        if is_number(expression):
            return power({ONE: number(expression)}, Fraction(1))
        if not expression.isidentifier():
            raise Refused(f"{expression!r} is no name")
        return {((expression, Fraction(1)),): Fraction(1)}
    head, *parts = expression
    if json.dumps(expression) in case.assumed:
        return {((f"@{json.dumps(expression)}", Fraction(1)),): Fraction(1)}
    if head == "+":
        return total_of([value_of(part, case) for part in parts], case)
    if head == "*":
        value: Value = {ONE: Fraction(1)}
        for part in parts:
            value = times(value, value_of(part, case))
        return value
    if head == "^":
        return power(value_of(parts[0], case), number(parts[1]))
    if len(parts) == 1 and (head in ("exp", "expm1") or (head == "log" and parts[0][:2] == ["+", "1"])):
        small = value_of(["+", *parts[0][2:]] if head == "log" else parts[0], case)
        require_growth(plus({}, vector_of(next(iter(small))), Fraction(-1)), case)
        return {ONE: Fraction(1)} if head == "exp" else small  # log(1 + x) and exp(x) - 1 are led by x
    raise Refused(f"what is {head!r}?")


def total_of(addends: list[Value], case: Case) -> Value:
    """Leading terms of a sum: those that all others are small against, or of one size with."""
    terms: Value = {}
    for addend in addends:
        for monomial, coefficient in addend.items():
            terms[monomial] = terms.get(monomial, Fraction(0)) + coefficient
    if any(c == 0 for c in terms.values()) or not 0 < len(terms) <= MOST_TERMS:
        raise Refused("leading terms cancel, or there are too many")
    unknown: list[Vector] = []
    for lead in terms:
        over = {m: plus(vector_of(lead), vector_of(m), Fraction(-1)) for m in terms}
        small = {m for m in terms if case.grows(over[m])}
        missing = [m for m in terms if m not in small and not case.stays(over[m])]
        if not missing:
            kept = {m: c for m, c in terms.items() if m not in small}
            if len({c > 0 for c in kept.values()}) > 1:
                raise Refused("terms of one size have opposite signs")
            return kept
        unknown += [over[m] for m in missing]
    raise Missing(unknown, case)


def times(one: Value, other: Value) -> Value:
    found: Value = {}
    for (m, c), (n, d) in product(one.items(), other.items()):
        factor, monomial = reduced(plus(dict(m), dict(n), Fraction(1)))
        found[monomial] = found.get(monomial, Fraction(0)) + c * d * factor
    if len(found) > MOST_TERMS or any(c == 0 for c in found.values()):
        raise Refused("leading terms cancel, or there are too many")
    return found


def power(value: Value, exponent: Fraction) -> Value:
    """A power of leading terms; of several, of what they are relative to one of them, as a variable of its own."""
    (monomial, coefficient), *rest = sorted(value.items())
    if coefficient == 0 or (coefficient < 0 and exponent.denominator != 1):
        raise Refused("a root of something negative, or nothing but 0")
    sign = -1 if coefficient < 0 and exponent.numerator % 2 else 1
    vector = plus({}, dict(monomial), exponent)
    for prime, count in factors(abs(coefficient)).items():
        vector = plus(vector, {f"#{prime}": count}, exponent)
    if rest:
        relative = sorted((reduced(plus(dict(m), dict(monomial), Fraction(-1))), c / coefficient) for m, c in rest)
        vector = plus(vector, {f"@{relative}": Fraction(1)}, exponent)
    factor, found = reduced(vector)
    if rest and exponent.denominator == 1 and 0 < exponent <= 4:
        whole: Value = {ONE: Fraction(1)}
        for _ in range(int(exponent)):
            whole = times(whole, value)
        return whole
    return {found: sign * factor}


def reduced(vector: Vector) -> tuple[Fraction, Monomial]:
    """Whole powers of primes as a number, and the rest."""
    factor, kept = Fraction(1), {}
    for name, exponent in vector.items():
        whole = exponent.numerator // exponent.denominator if name.startswith("#") else 0
        factor *= Fraction(int(name[1:])) ** whole if whole else 1
        if exponent != whole:
            kept[name] = exponent - whole
    return factor, tuple(sorted(kept.items()))


def factors(value: Fraction) -> dict[int, Fraction]:
    found: dict[int, Fraction] = {}
    for part, sign in ((value.numerator, 1), (value.denominator, -1)):
        left, prime = part, 2
        while left > 1:
            if prime > LARGEST_PRIME:
                raise Refused(f"{part} has a prime factor beyond {LARGEST_PRIME}")
            while left % prime == 0:
                found[prime] = found.get(prime, Fraction(0)) + sign
                left //= prime
            prime += 1
    return found


def names_in(expression: Any) -> set[str]:
    if isinstance(expression, str):
        return set() if is_number(expression) else {expression}
    return set().union(*(names_in(part) for part in expression[1:]))


def vector_of(monomial: Monomial) -> Vector:
    """Of what varies: numbers, and sums of terms of one size, stay between positive numbers."""
    return {name: exponent for name, exponent in monomial if name[0] not in "#@" and name != "pi"}


def plus(one: Vector, other: Vector, factor: Fraction) -> Vector:
    found = {name: one.get(name, Fraction(0)) + factor * other.get(name, Fraction(0)) for name in {*one, *other}}
    return {name: x for name, x in found.items() if x}


def is_number(text: str) -> bool:
    return text.lstrip("-")[:1].isdigit()


def number(text: Any) -> Fraction:
    if not isinstance(text, str) or len(text) > 400 or not set(text) <= set("0123456789/-"):
        raise Refused(f"{text!r} is no fraction")
    return Fraction(text)


def shown(vector: Vector) -> str:
    return " ".join(f"{name}^{x}" for name, x in sorted(vector.items())) or "1"


def written(value: Value) -> str:
    return " + ".join(f"{c} {shown(dict(m))}" for m, c in sorted(value.items())) or "0"
