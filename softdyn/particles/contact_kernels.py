"""The contact kernel of a law: made, compiled and loaded."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache as memoize
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import choose_target, loaded, manifest_of
from softdyn.laws import LawReference, find
from softdyn.scene.numbers import Range

Array = NDArray[np.float64]

#: Gauss points of the elastic energy, over sqrt(d/delta): F_ela is smooth in it, whether it starts as d or as d^(3/2).
POINTS = 12


@dataclass(frozen=True)
class ContactKernel:
    """A loaded contact kernel.

    Attributes
    ----------
    law, target, key : str
    contact : str
        What the contacts are: "film", whose gap is a state, "dry" or "rigid", which have none.
    fingerprint : str
        Digest of the law's equations.
    parameters : tuple of str
        All parameters of the law.
    uniform, varying : tuple of str
        What the arrays ``p`` and ``q`` hold.
    outputs : tuple of str
        What :func:`state` gives.
    fading : bool
        Whether contacts have a range.
    tangential : tuple of str
        What :func:`contacts` gives of tangential motion; empty without it.
    compile_s : float
        Time spent on deriving, building and loading it.
    contacts, state, energy, drag, rub : functions
        See the template ``contacts``, or ``gapless`` where there is no gap state; drag and rub are None in a kernel
        without.
    bounded : bool
        Whether its friction has a limit far apart; in a kernel without drag it does not matter.
    tabulated : bool
        Whether the law has splines through points, which have a range.
    pressed_only : bool
        Whether the law says nothing of surfaces that are pulled, delta < 0.
    positive : tuple of str
        Parameters that must be positive.
    ranges : mapping from str to (low, high, whether low is left out, whether high is)
        Within which some of the parameters must lie.
    """

    law: str
    target: str
    key: str
    contact: str
    fingerprint: str
    uniform: tuple[str, ...]
    varying: tuple[str, ...]
    outputs: tuple[str, ...]
    fading: bool
    tangential: tuple[str, ...]
    compile_s: float
    contacts: Callable[..., int]
    state: Callable[..., None]
    energy: Callable[..., None]
    drag: Callable[..., None] | None
    rub: Callable[..., None] | None
    bounded: bool
    pressed_only: bool
    tabulated: bool
    positive: tuple[str, ...]
    ranges: Mapping[str, Range]


def contact_manifest(reference: LawReference, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    """Derive a contact kernel; imports the derivation stage.

    Parameters
    ----------
    reference : LawReference
    target : str
    needs : mapping
        Fields of :class:`softdyn.derive.contact_equations.ContactNeeds`.
    """
    from softdyn.derive.checks import pressed_only
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.contact_kernel import contact_ir
    from softdyn.derive.emit import write
    from softdyn.derive.far_field import is_bounded
    from softdyn.derive.law import parameters_of, plain_ranges
    from softdyn.laws import load
    from softdyn.table_ranges import has_tables
    from softdyn.traits import traits_of

    law, depends = load(reference)
    ir = contact_ir(law, ContactNeeds(**needs))
    written = write(ir, target)
    return {
        "name": ir.name,
        "contact": traits_of(law).kind,
        "fingerprint": ir.provenance.fingerprint,
        "uniform": ir.arrays["p"],
        "varying": ir.arrays["q"],
        "outputs": ir.functions["state"].gives,
        "tangential": ir.settings["more"],
        "drag": ir.functions["drag"].gives,
        "bounded": not needs["drag"] or traits_of(law).kind == "dry" or is_bounded(law),
        "pressed_only": pressed_only(law),
        "tabulated": has_tables(law),
        "positive": [
            symbol.name for symbol in parameters_of(law, needs["tangential"], True, True) if symbol.is_positive
        ],
        "ranges": plain_ranges(law),
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "savings": [(saving.rule, saving.before, saving.after) for saving in ir.savings],
        "depends": depends,
    }


def get_contact_kernel(
    law: Any,
    target: str = "auto",
    *,
    varying: tuple[str, ...] = (),
    fading: bool = False,
    tangential: bool = False,
    drag: bool = False,
    rubbing: bool = False,
) -> ContactKernel:
    """Contact kernel of a law, from the cache or made now.

    Parameters
    ----------
    law : str, Path or ContactLaw
    target : "auto", "c" or "numba"
    varying : tuple of str
        Parameters that differ from contact to contact.
    fading : bool
        Whether contacts have a range.
    tangential : bool
        Whether particles slide and roll on one another.
    drag : bool
        Whether the fluid resists the particles by themselves.
    rubbing : bool
        Whether surfaces rub, with Coulomb friction.

    Raises
    ------
    LawError, SceneError, CompileError
    """
    began = time.perf_counter()
    target = choose_target(target)
    needs = {"varying": tuple(sorted(varying)), "fading": fading, "tangential": tangential, "drag": drag}
    needs |= {"rubbing": True} if rubbing else {}
    manifest = manifest_of(find(law), target, needs, "contacts", contact_manifest)
    key, _, functions = loaded(target, manifest)
    return ContactKernel(
        law=manifest["name"],
        target=target,
        key=key,
        contact=manifest["contact"],
        fingerprint=manifest["fingerprint"],
        uniform=tuple(manifest["uniform"]),
        varying=tuple(manifest["varying"]),
        outputs=tuple(manifest["outputs"]),
        fading=fading,
        tangential=tuple(manifest["tangential"]),
        compile_s=time.perf_counter() - began,
        contacts=functions.contacts,
        state=functions.state,
        energy=functions.energy,
        drag=functions.drag if manifest["drag"] else None,
        rub=functions.rub if rubbing else None,
        bounded=bool(manifest["bounded"]),
        pressed_only=bool(manifest["pressed_only"]),
        tabulated=bool(manifest["tabulated"]),
        positive=tuple(manifest["positive"]),
        ranges=manifest["ranges"],
    )


@memoize
def _fractions() -> tuple[Array, Array]:
    """Nodes and weights of the integral over d/delta from 0 to 1, d/delta = x^2."""
    x, weight = np.polynomial.legendre.leggauss(POINTS)
    x = (1 + x) / 2
    return np.ascontiguousarray(x**2), np.ascontiguousarray(weight * x)


def energies(kernel: ContactKernel, reach: float, overlap: Array, h: Array, p: Array, q: Array) -> tuple[Array, Array]:
    """Energy that each contact stores, and its slope in h at fixed delta.

    Parameters
    ----------
    kernel : ContactKernel
    reach : float
        Range of the contacts, a length.
    overlap : array, shape (n,)
        Sum of the radii less the distance of the centres.
    h : array, shape (n,)
        Gaps, lengths.
    p : array, shape (uniform parameters,)
    q : array
        Varying parameters, one contact after the other for each.
    """
    n = len(h)
    nodes, weights = _fractions()
    if kernel.contact != "film":
        stored = np.empty(n)
        kernel.energy(n, overlap, p, q, len(nodes), nodes, weights, stored)
        return stored, np.zeros(n)
    out = np.empty((2, n))
    within = (reach,) if kernel.fading else ()
    kernel.energy(n, *within, overlap, h, p, q, len(nodes), nodes, weights, out.reshape(-1))
    return out[0], out[1]
