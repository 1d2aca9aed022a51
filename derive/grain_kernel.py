"""The kernel of grains in dry contact: explicit steps of many, from the list of neighbours to their velocities.

Input: a law and what a scene needs of it. Output: a :class:`KernelIR` of the kind ``grains``. Its functions are
``force``, of a contact: the elastic force, its slope in the overlap, the coefficient of the dashpot, the tangential
stiffness; and ``friction``, the return map of Coulomb's law. Its arrays are ``p``, one number each, and ``q``, one
number for each pair of species. Its settings:

d, rotations : int
    Dimension of space, and rotations of a particle: 0 without friction.
damped, rolling, twisting, periodic, sheared : bool
    Whether there is a dashpot; what resists rolling and twisting; whether the box repeats itself, and is sheared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy
from sympy import Dummy, Expr, S, Symbol

from softdyn.derive import dynamics
from softdyn.derive.coulomb import keep, return_map
from softdyn.derive.dynamics import dF_ddelta
from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function
from softdyn.derive.law import (
    ContactLaw,
    code_names,
    in_code,
    is_dry,
    is_rigid,
    law_hash,
    parameters_of,
    particles_hash,
    tangential_expressions,
)
from softdyn.derive.printing import straight_line
from softdyn.derive.soundness import of_pressed, sound
from softdyn.derive.symbols import R, a, delta, h, size_ratio
from softdyn.errors import LawError

overlap = Symbol("overlap", positive=True)
F_ela, stiffness = Symbol("F_ela", real=True), Symbol("stiffness", positive=True)
dashpot, k_t = Symbol("dashpot", nonnegative=True), Symbol("k_t", positive=True)


@dataclass(frozen=True)
class GrainNeeds:
    """What a scene needs of the kernel of its grains; see the module.

    Parameters
    ----------
    varying : tuple of str
        Parameters that differ with the species; R, which the kernel has from the radii, is not among them.
    d : int
    rotations : int
    rolling, twisting, periodic, sheared : bool
    """

    d: int
    rotations: int
    varying: tuple[str, ...] = ()
    rolling: bool = False
    twisting: bool = False
    periodic: bool = False
    sheared: bool = False


def grain_ir(law: ContactLaw, needs: GrainNeeds) -> KernelIR:
    """Derive the kernel of grains of a law, and lower it to straight-line code.

    Raises
    ------
    LawError
        If the law is not that of a dry contact, if it has a remote force, or no tangential stiffness where one is
        needed; if a varying parameter is not the law's.
    """
    faults = []
    if is_rigid(law) or not is_dry(law):
        faults.append("explicit steps are for dry contacts: an elastic force, and no film (zeta = 0)")
    if law.F_adh != 0:
        faults.append("explicit steps know no remote force F_adh yet")
    if needs.rotations and law.tangential is None:
        faults.append(
            "friction is asked for, and the law declares no tangential stiffness: give it "
            "tangential=Tangential(sliding=oo, k_t=...)"
        )
    names = tuple(symbol.name for symbol in parameters_of(law, bool(needs.rotations)))
    faults += [f"{name!r} is no parameter; there are {', '.join(names)}" for name in needs.varying if name not in names]
    if faults:
        raise LawError(law.name, tuple(faults))
    definitions = grain_equations(law, bool(needs.rotations))
    codes = code_names(law)
    uniform = tuple(name for name in names if name not in (*needs.varying, R.name))
    coded = {"p": [codes[name] for name in uniform], "q": [codes[name] for name in needs.varying]}
    damped = definitions[dashpot] != 0

    def code(targets: Sequence[Symbol], found: dict[Symbol, Expr], given: Sequence[str]) -> Function:
        return function(straight_line(targets, found), [symbol.name for symbol in targets], given, coded)

    given = [F_ela, stiffness, *([dashpot] if damped else []), *([k_t] if needs.rotations else [])]
    declared = {name: getattr(law, name) for name in ("a", "F_ela")}
    declared |= {"dashpot": definitions[dashpot]} if damped else {}
    declared |= tangential_expressions(law.tangential) if needs.rotations and law.tangential is not None else {}
    return KernelIR(
        kind="grains",
        name=law.name,
        provenance=Provenance(
            title=f"Grains of the contact law {law.name}:",
            source=law.source or "no source given",
            declared="law",
            fingerprint=f"{law_hash(law)}, {particles_hash(law)}",
            declaration=tuple((name, str(expr)) for name, expr in declared.items()),
            sympy_version=sympy.__version__,
        ),
        arrays={"p": uniform, "q": needs.varying},
        functions={
            "force": code(given, definitions, ("overlap", "R")),
            "friction": code([keep], {keep: return_map()}, ("size", "most")),
        },
        settings={
            "d": needs.d,
            "rotations": needs.rotations,
            "damped": damped,
            "rolling": needs.rolling,
            "twisting": needs.twisting,
            "periodic": needs.periodic,
            "sheared": needs.sheared,
        },
        savings=(),
    )


def grain_equations(law: ContactLaw, tangential: bool) -> dict[Symbol, Expr]:
    """What a law says of two surfaces that touch, in terms of their overlap, 2 delta, and of earlier quantities."""
    law = in_code(law)
    values = dynamics.partials(law)
    size = Dummy("delta", positive=True)

    def touching(expr: Expr) -> Expr:
        """Without a gap, pressed together."""
        return of_pressed(expr.subs({h: S.Zero, size_ratio: S.One / 4})).subs(delta, size).subs(size, delta)

    found = {
        delta: overlap / 2,
        a: sound(touching(law.a)),
        F_ela: touching(law.F_ela),
        dF_ddelta: touching(sound(2 * dynamics.generic_dynamics(law.general).stiffness.subs(values))),
        # the overlap is twice the deflection
        stiffness: dF_ddelta / 2,
        dashpot: touching(S(getattr(law, "dashpot", S.Zero))),
    }
    if tangential and law.tangential is not None:
        found[k_t] = touching(law.tangential.k_t)
    return found
