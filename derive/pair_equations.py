"""The equations of a pair, from which its kernels are made.

Input: a law, and what the scene gives: a force, or the motion of the centres. Output: the equations of one contact, all
that there is to say of it (:func:`pair_equations`). The rules of :mod:`softdyn.derive.rules` leave out of them what a
scene does not need.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

from sympy import Expr, Symbol

from softdyn.derive import controls
from softdyn.derive.controls import BY_FORCE, SLOPES, X, centres_rate, lambda1, lambda2
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
from softdyn.derive.equations import Equations
from softdyn.derive.law import in_code, is_dry, is_rigid
from softdyn.derive.parameter_slopes import sensitive_outputs, slopes_by
from softdyn.derive.soundness import sound
from softdyn.derive.symbols import F, a
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
    sensitive : tuple of str
        Parameters by which the slopes of rates and outputs are wanted too (:mod:`softdyn.derive.parameter_slopes`); the
        kernel gives them behind the other outputs.
    """

    drive: str | tuple[Any, ...] = "constant"
    control: Control = "force"
    deflection: Deflection = "either"
    fixed: Mapping[str, str] = field(default_factory=dict)
    outputs: tuple[str, ...] | None = ("a", "X")
    sensitive: tuple[str, ...] = ()


@lru_cache(maxsize=32)
def pair_equations(law: ContactLaw, control: Control = "force", expression: bool = False) -> Equations:
    """Everything there is to say about a contact, before any specialisation.

    Where the force is given, delta follows from the force balance, and the state is ln h; else it is (ln h, delta),
    dX_dt stands for the given velocity, of the centres or of the base of a spring, and F is F_ela. Where an expression
    of time is what is given, ``expression``, the integration needs a slope more.

    Parameters
    ----------
    law : ContactLaw
    control : "force", "position", "velocity" or "spring"
    expression : bool
    """
    if is_rigid(law) or is_dry(law):
        return _one_sided_equations(law, control, expression)
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
    return Equations(definitions, frozenset(integrated(control, expression)) | named(OUTPUTS, definitions))


def _one_sided_equations(law: ContactLaw, control: Control, expression: bool) -> Equations:
    """Equations of rigid particles, which follow the gap, or of a dry contact, which follows the force.

    Raises
    ------
    LawError
        If another drive than a force is asked for: it would have to give the force, or the gap.
    """
    if control != "force":
        kind = "rigid particles (F_ela = oo)" if is_rigid(law) else "a dry contact (zeta = 0)"
        raise LawError(law.name, (f"{kind} can be driven by a force only, not by a {control}",))
    if is_dry(law) and (law.dashpot != 0 or law.F_adh != 0):
        what = "a dashpot" if law.dashpot != 0 else "a remote force"
        raise LawError(
            law.name,
            (f"two particles whose dry contact has {what} are a scene of many particles, with [particles]",),
        )
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
    return Equations(definitions, frozenset(integrated(control, expression)) | named(OUTPUTS, definitions))


def outputs_of(law: ContactLaw) -> tuple[str, ...]:
    """Those of OUTPUTS that a law has: rigid particles have no stiffness, a dry contact has no friction."""
    # the equations that the kernels are made of, so that they are derived once
    named = {output_name(symbol) for symbol in pair_equations(in_code(law)).definitions}
    return tuple(name for name in OUTPUTS if name in named)


@lru_cache(maxsize=32)
def with_slopes(law: ContactLaw, control: Control, expression: bool, parameters: tuple[str, ...]) -> Equations:
    """All of :func:`pair_equations`, and how rates and outputs depend on parameters, named as in the code.

    Parameters
    ----------
    law : ContactLaw
    control : "force", "position", "velocity" or "spring"
    expression : bool
        Whether an expression of time is what is given.
    parameters : tuple of str
        By which slopes are wanted.
    """
    equations = pair_equations(law, control, expression)
    if not parameters:
        return equations
    slopes = slopes_by(law, control, parameters)
    wanted = frozenset(sensitive_outputs(control == "force", parameters))
    definitions = {**equations.definitions, **slopes}
    return Equations(definitions, equations.wanted | {symbol for symbol in definitions if symbol.name in wanted})


def integrated(control: Control, expression: bool) -> tuple[Symbol, ...]:
    """What the integration itself uses; the slopes last: under a given force that of ln h and that of delta by ln h."""
    if control != "force":
        return F_ela, dF_ddelta, dh_dt, ddelta_dt, *SLOPES
    return F_ela, dF_ddelta, dh_dt, SLOPES[0], SLOPES[2], *((BY_FORCE,) if expression else ())


def named(names: tuple[str, ...], definitions: Mapping[Symbol, Expr]) -> frozenset[Symbol]:
    """Those of the defined symbols that are asked for by these names."""
    return frozenset(symbol for symbol in definitions if output_name(symbol) in names)


def output_name(symbol: Symbol) -> str:
    """Name under which a symbol is asked for."""
    return "dX_dt" if symbol == centres_rate else symbol.name
