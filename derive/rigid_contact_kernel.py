"""The kernel of many contacts of rigid grains: sweeps that solve one after another, and Newton's matrix of all.

Input: the dimension of space. Output: a :class:`KernelIR` of the kind ``rigid``. It has no parameters: its arrays are
empty. Its functions are the relative velocity, the mobilities, the projected impulse, what an impulse does to both
grains, Newton's step of a contact that sticks and of one that slides, and the blocks H^T D H of both grains.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256

import sympy
from sympy import Expr, Symbol
from sympy import ImmutableMatrix as Matrix

from softdyn.derive.kernel_form import Function, KernelIR, Provenance, function
from softdyn.derive.printing import straight_line
from softdyn.derive.rigid_contact import (
    P_n,
    across,
    bound,
    frame_of,
    length,
    light_i,
    light_j,
    linearised,
    loose_i,
    loose_j,
    mu,
    projection,
    rho,
    rigid_contact,
    slack,
    soft,
    turns,
    vector,
    w_n,
    w_t,
)

SOURCE = (
    "P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353; M. Jean, Comput. Methods Appl. Mech. Eng. "
    "177 (1999) 235"
)
#: Squares of what a projection changes, and of what it gives.
change, size = Symbol("change", real=True), Symbol("size", real=True)


def entries(name: str, rows: int, columns: int) -> list[Symbol]:
    """Symbols of a matrix, row by row: name_0_0, name_0_1, ...

    Parameters
    ----------
    name : str
    rows, columns : int
    """
    return [Symbol(f"{name}_{a}_{b}", real=True) for a in range(rows) for b in range(columns)]


def rigid_ir(d: int) -> KernelIR:
    """Lower the equations of rigid contacts in d dimensions to straight-line code."""
    contact, step = rigid_contact(d), projection(d)
    n, width = contact.n, d + turns(d)
    drift, P = vector("drift", d), step.P
    mobilities = dict(zip((w_n, w_t), contact.mobilities, strict=True))
    slip = Matrix(contact.H * contact.velocities + drift)
    kicks = contact.H.T * P
    kick = [Symbol(f"kick_{grain}_{k}", real=True) for grain in "ij" for k in range(width)]
    changed = P - step.new
    told = {change: (changed.T * changed)[0], size: (step.new.T * step.new)[0]}
    held, D = vector("held", d), entries("D", d, d)
    blocks = _blocks(d, contact.H, Matrix(d, d, D))
    names = dict(zip([Symbol(f"{one.name}", real=True) for one in step.U], slip, strict=True))
    masses = [light_i, light_j, loose_i, loose_j]
    given = _names(n, contact.velocities, drift, step.U, P, [bound, w_n, w_t, mu, rho, soft], masses, D)

    def code(targets: Sequence[Symbol], definitions: dict[Symbol, Expr]) -> Function:
        return function(straight_line(targets, definitions), [one.name for one in targets], given, {})

    functions = {
        "slip": code(list(names), names),
        "mobility": code([w_n, w_t], mobilities),
        "project": code([*step.new, change, size], {**step.definitions, **told}),
        "kick": code(kick, dict(zip(kick, kicks, strict=True))),
        "status": code(
            [P_n, *([slack] if d > 1 else []), change],
            {**projection(d, smooth=True).definitions, **told},
        ),
        "stick": code([*held, *D], _newton(d, False)),
        "slide": code([*held, *D], _newton(d, True)) if d > 1 else code([], {}),
        "blocks": code(list(blocks), blocks),
    }
    equations = {str(symbol): str(expr) for symbol, expr in {**mobilities, **step.definitions}.items()}
    text = "\n".join(f"{name} = {expr}" for name, expr in equations.items())
    return KernelIR(
        kind="rigid",
        name=f"rigid_{d}d",
        provenance=Provenance(
            title=f"Contacts of rigid grains, dimension {d}:",
            source=SOURCE,
            declared="equations",
            fingerprint=sha256(text.encode()).hexdigest()[:16],
            declaration=tuple(equations.items()),
            sympy_version=sympy.__version__,
        ),
        arrays={},
        functions=functions,
        settings={"dimension": d, "turns": turns(d)},
        savings=(),
    )


def _newton(d: int, slides: bool) -> dict[Symbol, Expr]:
    """P' where U' = U, and D, in Cartesian components."""
    step, branch, n = projection(d, smooth=True), linearised(d, slides), rigid_contact(d).n
    changed = step.P - step.new
    definitions = dict(step.definitions)
    if slides:
        # whatever the direction where q_t is 0: it is multiplied by that
        definitions[length] = sympy.Piecewise((sympy.sqrt(across), across > 0), (1, True))
        frame = frame_of(d)
        A, D = frame * branch.A * frame.T, frame * branch.D * frame.T
    else:
        # whatever the frame, both are the same in all directions across the normal
        last = d - 1
        for matrix in (branch.A, branch.D):
            assert matrix.is_diagonal()
            assert len({matrix[k, k] for k in range(1, d)}) <= 1
        A, D = (
            Matrix(m[last, last] * (sympy.eye(d) - n * n.T) + m[0, 0] * n * n.T) if d > 1 else m
            for m in (branch.A, branch.D)
        )
    definitions |= dict(zip(vector("held", d), step.P - A * changed, strict=True))
    return definitions | dict(zip(entries("D", d, d), D, strict=True))


def _blocks(d: int, H: Matrix, D: Matrix) -> dict[Symbol, Expr]:
    """Blocks ii, ij, ji and jj of H^T D H."""
    width = d + turns(d)
    parts = {"i": H[:, :width], "j": H[:, width:]}
    return {
        symbol: entry
        for one, left in parts.items()
        for other, right in parts.items()
        for symbol, entry in zip(entries(f"block_{one}{other}", width, width), left.T * D * right, strict=True)
    }


def _names(*groups: Matrix | list[Symbol]) -> list[str]:
    return [symbol.name for group in groups for symbol in group]
