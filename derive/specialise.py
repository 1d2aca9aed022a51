"""Taking away from a law's equations what a scene does not need.

Input: the equations of one contact (:func:`contact_equations`) and what the scene needs. Output: the equations left,
and for each rule the operations that it saved. The rules are pure, and applied in order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from sympy import Abs, Dummy, Expr, Max, Min, Rational, S, Symbol, sign
from sympy.core.relational import Relational

from softdyn.derive import controls
from softdyn.derive.controls import SLOPES, X, centres_rate, compliance, lambda1, lambda2
from softdyn.derive.dynamics import (
    C,
    D,
    F_adh,
    F_ela,
    by_gap_of,
    ddelta_dt,
    dF_ddelta,
    dF_dh,
    dF_dt,
    dh_dt,
    dX_dt,
    generic_dynamics,
    lambda1_of,
    partials,
    zeta,
)
from softdyn.derive.law import in_code, is_dry, is_rigid
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import F, a, delta
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

Deflection = Literal["either", "compression", "tension"]
Control = Literal["force", "position", "velocity", "spring"]

#: What a kernel can be asked for, at a state (h, delta) under the force F.
OUTPUTS = tuple(symbol.name for symbol in (a, F_ela, zeta, F_adh, C, D, dh_dt, ddelta_dt, dX_dt, X, lambda1, lambda2))


#: Of these where the centres are moved: each follows from earlier ones.
ORDER = (
    a, F_ela, F, zeta, F_adh, dF_ddelta, dF_dh, C, D, dh_dt, ddelta_dt, dF_dt, centres_rate, X, lambda1, lambda2,
)  # fmt: skip


@dataclass(frozen=True)
class Needs:
    """What a scene needs of a kernel.

    Parameters
    ----------
    drive : "constant", "table", or a parsed expression of t (:mod:`softdyn.expression`)
    control : "force", "position", "velocity" or "spring"
        What the drive gives: the external force, the distance of the centres, its rate, or the position of the base of
        a spring that pushes them.
    deflection : "either", "compression" or "tension"
        The signs that delta can take.
    fixed : mapping from str to str
        Parameters whose values are known, as decimal numbers; the others stay arguments.
    outputs : tuple of str, or None
        Of :data:`OUTPUTS`; None stands for all that the law has.
    """

    drive: str | tuple = "constant"
    control: Control = "force"
    deflection: Deflection = "either"
    fixed: Mapping[str, str] = field(default_factory=dict)
    outputs: tuple[str, ...] | None = ("a", "X")


@dataclass(frozen=True)
class Equations:
    """The equations of one contact: each symbol in terms of h, delta, F, dF_dt, parameters and earlier symbols.

    ``wanted`` are those that the kernel uses; whatever these do not need is not emitted.
    """

    definitions: dict[Symbol, Expr]
    wanted: frozenset[Symbol]


@lru_cache(maxsize=32)
def contact_equations(law: ContactLaw, control: Control = "force") -> Equations:
    """Everything there is to say about a contact, before any specialisation.

    Where the force is given, delta follows from the force balance, and the state is ln h; else it is (ln h, delta),
    dX_dt stands for the given velocity, of the centres or of the base of a spring, and F is F_ela.
    """
    if is_rigid(law) or is_dry(law):
        return _one_sided_equations(law, control)
    values, generic = partials(law), generic_dynamics(law.general)
    forms = controls.rates() | {X: generic.X} | (controls.by_force() if control == "force" else controls.by_centres())
    forms = {**forms, lambda2: controls.by_force()[lambda2]}
    slopes = controls.slopes_of(law, forms.values())
    definitions = {
        a: sound(law.a),
        F_ela: values[F_ela],
        zeta: values[zeta],
        F_adh: values[F_adh],
        dF_ddelta: sound(2 * generic.stiffness.subs(values)),
        dF_dh: by_gap_of(law),
        C: dF_ddelta / 2,
        **{symbol: form.xreplace(slopes) for symbol, form in forms.items()},
        # at delta = 0 as well
        lambda1: lambda1_of(law, dF_ddelta),
    }
    if control != "force":
        ordered = (*ORDER, *SLOPES)
        definitions = {symbol: definitions[symbol] for symbol in ordered}
    return Equations(definitions, _integrated(control) | _named(OUTPUTS, definitions))


def _one_sided_equations(law: ContactLaw, control: Control) -> Equations:
    """Equations of rigid particles, which follow the gap, or of a dry contact, which follows the force.

    Raises
    ------
    LawError
        If another drive than a force is asked for: it would have to give the force, or the gap.
    """
    if control != "force":
        kind = "rigid particles (F_ela = oo)" if is_rigid(law) else "a dry contact (zeta = 0)"
        raise LawError(law.name, (f"{kind} can be driven by a force only, not by a {control}",))
    values, generic = partials(law), generic_dynamics(law.general)
    if is_dry(law):
        definitions = {
            a: sound(law.a),
            F_ela: values[F_ela],
            dF_ddelta: sound(2 * generic.stiffness.subs(values)),
            C: dF_ddelta / 2,
            **controls.without_film(),
        }
    else:
        forms = controls.by_gap()
        slopes = controls.slopes_of(law, forms.values())
        definitions = {
            a: sound(law.a),
            F_ela: F,  # they transmit any force
            zeta: values[zeta],
            F_adh: values[F_adh],
            **{symbol: form.xreplace(slopes) for symbol, form in forms.items()},
        }
    return Equations(definitions, _integrated(control) | _named(OUTPUTS, definitions))


def outputs_of(law: ContactLaw) -> tuple[str, ...]:
    """Those of OUTPUTS that a law has: rigid particles have no stiffness, a dry contact has no friction."""
    # the equations that the kernels are made of, so that they are derived once
    named = {output_name(symbol) for symbol in contact_equations(in_code(law)).definitions}
    return tuple(name for name in OUTPUTS if name in named)


def _integrated(control: Control) -> frozenset[Symbol]:
    """What the integration itself uses."""
    if control == "force":
        return frozenset({F_ela, dF_ddelta, dh_dt, SLOPES[0], SLOPES[2]})
    return frozenset({F_ela, dF_ddelta, dh_dt, ddelta_dt, *SLOPES})


def _named(names: tuple[str, ...], definitions: Mapping[Symbol, Expr]) -> frozenset[Symbol]:
    return frozenset(symbol for symbol in definitions if output_name(symbol) in names)


def output_name(symbol: Symbol) -> str:
    """Name under which a symbol is asked for."""
    return "dX_dt" if symbol == centres_rate else symbol.name


@dataclass(frozen=True)
class Rule:
    """One specialisation: its name, when it applies, and what it does."""

    name: str
    applies: Callable[[Equations, Needs], bool]
    apply: Callable[[Equations, Needs], Equations]


def _map(equations: Equations, change: Callable[[Expr], Expr]) -> Equations:
    return replace(equations, definitions={symbol: change(expr) for symbol, expr in equations.definitions.items()})


def one_sign(equations: Equations, needs: Needs) -> Equations:
    """Without abs(delta) and sign(delta), nor the branches of the other sign."""
    size = Dummy("delta", positive=True)
    side = 1 if needs.deflection == "compression" else -1

    def resolve(expr: Expr) -> Expr:
        if not expr.has(Abs, sign, Max, Min, Relational):
            return expr
        return expr.subs(delta, side * size).subs(size, side * delta)

    return _map(equations, resolve)


def constant_force(equations: Equations, needs: Needs) -> Equations:
    """Without the terms in dF_ext/dt."""
    return _map(equations, lambda expr: expr.subs(dF_dt, 0))


def no_remote_force(equations: Equations, needs: Needs) -> Equations:
    """Without F_adh."""
    return _map(equations, lambda expr: expr.subs(F_adh, 0))


def fixed_parameters(equations: Equations, needs: Needs) -> Equations:
    """With numbers, exact, in the place of parameters."""
    known = {name: Rational(value) for name, value in needs.fixed.items()}

    def insert(expr: Expr) -> Expr:
        return expr.subs({symbol: known[symbol.name] for symbol in expr.free_symbols if symbol.name in known})

    return _map(equations, insert)


def asked_outputs(equations: Equations, needs: Needs) -> Equations:
    """Without outputs that nobody asked for."""
    wanted = _integrated(needs.control) | _named(needs.outputs or (), equations.definitions)
    return replace(equations, wanted=wanted)


def rigid_drive(equations: Equations, needs: Needs) -> Equations:
    """Without the compliance of a spring, where the centres themselves are moved."""
    return _map(equations, lambda expr: expr.subs(compliance, 0))


RULES = (
    Rule("one sign of delta", lambda _, needs: needs.deflection != "either", one_sign),
    Rule("constant force", lambda _, needs: needs.control == "force" and needs.drive == "constant", constant_force),
    Rule("rigid drive", lambda _, needs: needs.control in ("position", "velocity"), rigid_drive),
    Rule("no remote force", lambda equations, _: equations.definitions.get(F_adh) == S.Zero, no_remote_force),
    Rule("fixed parameters", lambda _, needs: bool(needs.fixed), fixed_parameters),
    Rule(
        "outputs asked for",
        lambda equations, needs: (
            needs.outputs is not None
            and bool(_named(OUTPUTS, equations.definitions) - _named(needs.outputs, equations.definitions))
        ),
        asked_outputs,
    ),
)
