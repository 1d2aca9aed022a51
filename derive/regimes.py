"""The asymptotic regimes of a law in the plane of gap and force, and the crossovers between them.

Input: the limits that a law claims. Output: the leading forms of deflection and gap rate, dimensionless in x = h/R and
kappa = F/(E R^2); the conditions under which each limit's ordering of lengths holds; and the lines on which two regimes
meet, from the equality of their leading forms.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sympy import Eq, Expr, S, Symbol, diff, powsimp, simplify, solve

from softdyn.derive.symbols import E, F, R, delta, eta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

#: Gap over radius, and force over E R^2.
x = Symbol("x", positive=True)
kappa = Symbol("kappa", positive=True)


@dataclass(frozen=True)
class Regime:
    """One limit of a law, at constant force, dimensionless.

    Attributes
    ----------
    name : str
    order : tuple of Expr
        h, delta and R from the smallest to the largest.
    delta : Expr
        Leading form of delta/R, in x and kappa.
    dh_dt : Expr
        Leading form of -(dh/dt)/V, in x and kappa, where V = F/(eta R).
    ratios : tuple of Expr
        Each length of the order over the next, in x and kappa: the regime is where all are below 1.
    """

    name: str
    order: tuple[Expr, ...]
    delta: Expr
    dh_dt: Expr
    ratios: tuple[Expr, ...]


@dataclass(frozen=True)
class Crossover:
    """Where two regimes meet, or where one ends: with an empty ``second``, at delta = R, the edge of the model."""

    first: str
    second: str
    line: Eq


def regimes(law: ContactLaw) -> tuple[Regime, ...]:
    """Return the regimes in compression for which the law claims both delta and dh/dt.

    Raises
    ------
    ValueError
        If a claim does not reduce to x and kappa: the law has another length or force of its own.
    """
    return tuple(
        _regime(limit) for limit in law.limits if delta in limit.order and {"delta", "dh_dt"} <= set(limit.claims)
    )


def _regime(limit: Limit) -> Regime:
    deflection = _dimensionless(limit.claims["delta"] / R, limit)
    sizes = {h: x, delta: deflection, R: S.One}
    pairs = zip(limit.order, limit.order[1:], strict=False)
    return Regime(
        name=limit.name,
        order=limit.order,
        delta=deflection,
        dh_dt=_dimensionless(-limit.claims["dh_dt"] * eta * R / F, limit),
        ratios=tuple(powsimp(sizes[small] / sizes[large]) for small, large in pairs),
    )


def _dimensionless(claim: Expr, limit: Limit) -> Expr:
    form = powsimp(claim.subs({F: kappa * E * R**2, h: x * R}), force=True)
    form = simplify(form) if form.free_symbols - {x, kappa} else form
    if form.free_symbols - {x, kappa}:
        raise ValueError(f"limit {limit.name!r}: {form} depends on more than h/R and kappa")
    return form


def exponent(form: Expr, variable: Symbol = x) -> Expr:
    """Return dln(form)/dln(variable), at constant force: lambda1 or lambda2 of a leading form."""
    return simplify(variable * diff(form, variable) / form)


def prefactor(form: Expr) -> Expr:
    """Return the number in front of the powers of x and kappa of a leading form.

    Raises
    ------
    ValueError
        If the form is not a number times such powers.
    """
    number = simplify(form / (x ** exponent(form) * kappa ** exponent(form, kappa)))
    if number.free_symbols:
        raise ValueError(f"{form} is not a product of powers of h/R and kappa")
    return number


def crossovers(law: ContactLaw) -> tuple[Crossover, ...]:
    """Lines on which regimes meet.

    Two regimes are neighbours if their orders differ by one exchange of two lengths next to each other; they meet
    where their deflections are equal. A regime in which only R exceeds delta ends, with the model, at delta = R.
    """
    found = regimes(law)
    met = [
        Crossover(one.name, other.name, _line(one.delta, other.delta))
        for i, one in enumerate(found)
        for other in found[i + 1 :]
        if _neighbours(one.order, other.order)
    ]
    return (
        *met,
        *(Crossover(one.name, "", _line(one.delta, S.One)) for one in found if (delta, R) in _pairs(one.order)),
    )


def _pairs(order: tuple[Expr, ...]) -> set[tuple[Expr, Expr]]:
    return set(itertools.pairwise(order))


def _neighbours(one: tuple[Expr, ...], other: tuple[Expr, ...]) -> bool:
    differing = [i for i, (left, right) in enumerate(zip(one, other, strict=True)) if left != right]
    return len(differing) == 2 and differing[1] == differing[0] + 1


def _line(one: Expr, other: Expr) -> Eq:
    """The equality of two leading forms, solved for kappa, or for x where kappa drops out."""
    quotient = powsimp(one / other, force=True)
    variable = kappa if kappa in quotient.free_symbols else x
    (solution,) = solve(Eq(quotient, 1), variable)
    return Eq(variable, solution)
