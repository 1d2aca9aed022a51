"""Claims as lemmas for Isabelle's ``real_asymp``, along rays of their order.

Input: what a certificate states. Output: a theory as text: along h = x^-1, delta = x^-2 and the like, x to infinity,
the quotient of quantity and claim tends to 1 at any positive fixed parameters. A ray is less than the set that a
certificate speaks of; what proves it shares nothing with this tool.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import gcd
from typing import Any

from softdyn.certificate_checker import is_number, names_in

#: Exponents of x that are tried, and rays that are taken of an order.
EXPONENTS, MOST_RAYS = range(-3, 4), 2
HEAD = 'theory {name}\n  imports "HOL-Real_Asymp.Real_Asymp"\nbegin\n'


def theory(name: str, statements: Sequence[Mapping[str, Any]]) -> str:
    """A theory with a lemma for each statement and ray."""
    found = [lemma(statement, ray, i) for statement in statements for i, ray in enumerate(rays(statement))]
    return HEAD.format(name=name) + "".join(f"\n{text}" for text in found) + "\nend\n"


def lemma(statement: Mapping[str, Any], ray: Mapping[str, int], number: int) -> str:
    """One lemma: the claim along a ray.

    Parameters
    ----------
    statement : mapping
        As a certificate has it.
    ray : mapping from str to int
        Power of x that each symbol is.
    number : int
        Of the lemma, for its name.
    """
    known = {name: f"(x powr ({power}))" for name, power in ray.items()}
    for name, expression in [*statement.get("named", []), *statement["definitions"]]:
        known[name] = isabelle(expression, known)
    quantity, claim = (isabelle(statement[key], known) for key in ("quantity", "claim"))
    free = sorted(set(re.findall(r"\bv_\w+", quantity + claim)))
    name = re.sub(r"\W+", "_", statement["claim_of"])
    positive = "".join(f' "{symbol} > 0"' for symbol in free)
    positive += "".join(f' "{isabelle(one, {})} > 0"' for one in statement["assumed"])
    fixes = f"  fixes {' '.join(free)} :: real\n" if free else ""
    assumes = f"  assumes{positive}\n" if positive else ""
    goal = rf'  shows "((\<lambda>x::real. {quantity} / {claim}) \<longlongrightarrow> 1) at_top"'
    return f"lemma {name}_{number}:\n{fixes}{assumes}{goal}\n  {'using assms ' if positive else ''}by real_asymp\n"


def isabelle(expression: Any, known: Mapping[str, str]) -> str:
    """An expression in Isabelle's syntax for reals."""
    if isinstance(expression, str):
        if is_number(expression):
            return f"({expression})"
        return "pi" if expression == "pi" else known.get(expression, f"v_{expression}")
    head, *parts = expression
    if head == "^" and not isinstance(parts[1], str):
        return f"({isabelle(parts[0], known)} powr {isabelle(parts[1], known)})"
    if head == "^":
        return f"({isabelle(parts[0], known)} powr ({parts[1]}))" if Fraction(parts[1]).denominator > 1 else (
            f"({isabelle(parts[0], known)} ^ {parts[1]})"
            if Fraction(parts[1]) > 0
            else f"(1 / {isabelle(parts[0], known)} ^ {parts[1][1:]})"
        )  # fmt: skip
    if head == "expm1":
        return f"(exp {isabelle(parts[0], known)} - 1)"
    if head in ("exp", "log"):
        return f"({'ln' if head == 'log' else head} {isabelle(parts[0], known)})"
    return "(" + f" {head} ".join(isabelle(part, known) for part in parts) + ")"


def rays(statement: Mapping[str, Any]) -> list[dict[str, int]]:
    """Powers of x for what varies that have the order, the simplest first; none where it holds more than products."""
    varied = sorted({name for pair in statement["order"] for one in pair for name in names_in(one)} - {"pi"})
    varied = [name for name in varied if name not in statement["fixed"]]
    found = []
    for powers in sorted(product(EXPONENTS, repeat=len(varied)), key=lambda one: (sum(map(abs, one)), one)):
        ray = dict(zip(varied, powers, strict=True))
        sizes = [(_exponent(small, ray), _exponent(large, ray)) for small, large in statement["order"]]
        if any(one is None or other is None for one, other in sizes):
            return []
        if gcd(*powers) == 1 and all(one < other for one, other in sizes):  # type: ignore[operator]
            found.append(ray)
    return found[:MOST_RAYS]


def _exponent(expression: Any, ray: Mapping[str, int]) -> Fraction | None:
    if isinstance(expression, str):
        return Fraction(ray.get(expression, 0))
    head, *parts = expression
    if head not in "*^":
        return None
    total = Fraction(0)
    for part in parts[:1] if head == "^" else parts:
        inner = _exponent(part, ray)
        if inner is None:
            return None
        total += inner
    return total * Fraction(parts[1]) if head == "^" else total
