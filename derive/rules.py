"""Leaving out of a kernel's equations what a scene does not need: one ordered list of rules for every kind of kernel.

Input: equations and what the scene needs of them, of a pair, of contacts or of elements. Output: the equations left,
and for each rule that applied the operations that it saved. A rule is pure; it says whose needs it reads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from sympy import Abs, Dummy, Expr, Integer, Max, Min, Rational, S, Symbol, sign
from sympy.core.relational import Relational

from softdyn.derive.contact_equations import ContactNeeds, film, film_h, grip, grip_h, w, w_h
from softdyn.derive.controls import compliance, remote_delta, remote_h
from softdyn.derive.dynamics import F_adh, dF_dt
from softdyn.derive.element_equations import ElementEquations, ElementNeeds
from softdyn.derive.equations import Equations, changed, cost, followed, inserted
from softdyn.derive.pair_equations import OUTPUTS, Needs, integrated, named
from softdyn.derive.symbols import delta, size_ratio

#: What contacts are without a range: all of their weight, everywhere.
WHOLE = dict.fromkeys((w, film, grip), Integer(1)) | dict.fromkeys((w_h, film_h, grip_h), Integer(0))
#: What follows from a law without a remote force.
NOT_REMOTE = dict.fromkeys((F_adh, remote_h, remote_delta), Integer(0))


@dataclass(frozen=True)
class Rule:
    """One specialisation.

    Attributes
    ----------
    name : str
    of : tuple of types
        Whose needs it reads: the kinds of kernels that it is a rule of.
    applies, apply : functions of equations and needs
        When it does something, and what.
    """

    name: str
    of: tuple[type, ...]
    applies: Callable[[Any, Any], bool]
    apply: Callable[[Any, Any], Equations]


@dataclass(frozen=True)
class Saving:
    """Operations of a kernel's equations before and after one rule."""

    rule: str
    before: int
    after: int


def specialised(equations: Equations, needs: Any, rules: Iterable[Rule]) -> tuple[Equations, tuple[Saving, ...]]:
    """Apply those rules that are for these needs, in order.

    Parameters
    ----------
    equations : Equations
    needs : Needs, ContactNeeds, ElementNeeds or other
    rules : iterable of Rule
    """
    savings, before = [], cost(equations)
    for rule in rules:
        if isinstance(needs, rule.of) and rule.applies(equations, needs):
            equations = rule.apply(equations, needs)
            after = cost(equations)
            savings.append(Saving(rule.name, before, after))
            before = after
    return equations, tuple(savings)


def one_sign(equations: Equations, needs: Needs) -> Equations:
    """Without abs(delta) and sign(delta), nor the branches of the other sign."""
    side = 1 if needs.deflection == "compression" else -1
    return changed(equations, lambda expr: _of_sign(expr, side))


@lru_cache(maxsize=4096)
def _of_sign(expr: Expr, side: int) -> Expr:
    """An expression at deflections of one sign: kernels of one law, whatever else they leave out, ask for the same."""
    if not expr.has(Abs, sign, Max, Min, Relational):
        return expr
    size = Dummy("delta", positive=True)
    return expr.subs(delta, side * size).subs(size, side * delta)


def constant_force(equations: Equations, needs: Needs) -> Equations:
    """Without the terms in dF_ext/dt."""
    return inserted(equations, {dF_dt: S.Zero})


def rigid_drive(equations: Equations, needs: Needs) -> Equations:
    """Without the compliance of a spring, where the centres themselves are moved."""
    return inserted(equations, {compliance: S.Zero})


def no_range(equations: Equations, needs: ContactNeeds) -> Equations:
    """Without the weights of a contact that fades."""
    return inserted(equations, WHOLE)


def no_remote_force(equations: Equations, needs: Needs | ContactNeeds) -> Equations:
    """Without F_adh and its slopes."""
    return inserted(equations, NOT_REMOTE)


def equal_radii(equations: Equations, needs: ContactNeeds) -> Equations:
    """Without the ratio of the radii R1 R2/(R1 + R2)^2, which is 1/4 then."""
    return inserted(equations, {size_ratio: Rational(1, 4)})


def absent_coefficients(equations: ElementEquations, needs: ElementNeeds) -> Equations:
    """Without the terms of coefficients and parameters that are zero."""
    return followed(inserted(equations, {s: x for name in needs.absent for s, x in equations.absent[name].items()}))


def unit_coefficients(equations: ElementEquations, needs: ElementNeeds) -> Equations:
    """Without factors and gradients of coefficients that are one."""
    return followed(inserted(equations, {s: x for name in needs.unit for s, x in equations.unit[name].items()}))


def uniform_coefficients(equations: ElementEquations, needs: ElementNeeds) -> Equations:
    """Without the gradients of coefficients that are uniform."""
    return followed(inserted(equations, {s: x for name in needs.uniform for s, x in equations.uniform[name].items()}))


def fixed_parameters(equations: Equations, needs: Needs) -> Equations:
    """With numbers, exact, in the place of parameters."""
    known = {name: Rational(value) for name, value in needs.fixed.items()}

    def insert(expr: Expr) -> Expr:
        return expr.subs({symbol: known[symbol.name] for symbol in expr.free_symbols if symbol.name in known})

    return changed(equations, insert)


def asked_outputs(equations: Equations, needs: Needs) -> Equations:
    """Without outputs that nobody asked for."""
    used = frozenset(integrated(needs.control, isinstance(needs.drive, tuple)))
    return replace(equations, wanted=used | named(needs.outputs or (), equations.definitions))


def _unasked(equations: Equations, needs: Needs) -> frozenset[Symbol]:
    """Outputs that nobody asked for."""
    if needs.outputs is None:
        return frozenset()
    return named(OUTPUTS, equations.definitions) - named(needs.outputs, equations.definitions)


def _without_remote_force(equations: Equations, _: Needs | ContactNeeds) -> bool:
    return bool(equations.definitions.get(F_adh) == S.Zero)


RULES = (
    Rule("one sign of delta", (Needs,), lambda _, needs: needs.deflection != "either", one_sign),
    Rule(
        "constant force",
        (Needs,),
        lambda _, needs: needs.control == "force" and needs.drive == "constant",
        constant_force,
    ),
    Rule("rigid drive", (Needs,), lambda _, needs: needs.control in ("position", "velocity"), rigid_drive),
    Rule("no range", (ContactNeeds,), lambda _, needs: not needs.fading, no_range),
    Rule("no remote force", (Needs, ContactNeeds), _without_remote_force, no_remote_force),
    Rule(
        "equal radii",
        (ContactNeeds,),
        lambda _, needs: needs.tangential and size_ratio.name not in needs.varying,
        equal_radii,
    ),
    Rule("absent coefficients", (ElementNeeds,), lambda _, needs: bool(needs.absent), absent_coefficients),
    Rule("unit coefficients", (ElementNeeds,), lambda _, needs: bool(needs.unit), unit_coefficients),
    Rule("uniform coefficients", (ElementNeeds,), lambda _, needs: bool(needs.uniform), uniform_coefficients),
    Rule("fixed parameters", (Needs,), lambda _, needs: bool(needs.fixed), fixed_parameters),
    Rule("outputs asked for", (Needs,), lambda equations, needs: bool(_unasked(equations, needs)), asked_outputs),
)
