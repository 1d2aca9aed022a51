"""The kernel of a potential: made, compiled and loaded; and what it makes of many pairs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import choose_target, kept_manifest, loaded
from softdyn.laws import LawReference, find_potential, load_potential
from softdyn.scene.numbers import Range

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PotentialKernel:
    """A loaded kernel of a potential.

    Attributes
    ----------
    potential, target, key, fingerprint : str
    parameters : tuple of str
        What the array ``p`` holds.
    positive, not_negative : tuple of str
        Parameters that must be so.
    ranges : mapping from str to (low, high, whether low is left out, whether high is)
        Within which some of the parameters must lie.
    pairs, activities : functions
        See the template ``potentials``; ``activities`` is None without an activation.
    """

    potential: str
    target: str
    key: str
    fingerprint: str
    parameters: tuple[str, ...]
    positive: tuple[str, ...]
    not_negative: tuple[str, ...]
    ranges: Mapping[str, Range]
    pairs: Callable[..., None]
    activities: Callable[..., None] | None


def potential_manifest(reference: LawReference, target: str) -> dict[str, Any]:
    """Derive a potential's kernel; imports the derivation stage."""
    from softdyn.derive.emit import write
    from softdyn.derive.potential import ranges_of
    from softdyn.derive.potential_kernel import potential_ir

    potential, depends = load_potential(reference)
    ir = potential_ir(potential)
    written = write(ir, target)
    ranges = {
        symbol.name: [float(one.start), float(one.end), bool(one.left_open), bool(one.right_open)]
        for symbol, one in ranges_of(potential).items()
    }
    return {
        "name": ir.name,
        "fingerprint": ir.provenance.fingerprint,
        "parameters": ir.arrays["p"],
        "positive": [symbol.name for symbol in potential.parameters if symbol.is_positive],
        "not_negative": [symbol.name for symbol in potential.parameters if symbol.is_nonnegative],
        "ranges": ranges,
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "depends": depends,
    }


def get_potential_kernel(potential: Any, target: str = "auto") -> PotentialKernel:
    """Kernel of a potential, from the cache or made now.

    Parameters
    ----------
    potential : str, Path or Potential
    target : "auto", "c" or "numba"

    Raises
    ------
    LawError, SceneError, CompileError
    """
    target, reference = choose_target(target), find_potential(potential)
    if reference.law is not None:
        from softdyn.derive.potential import potential_hash

        identity = ["object", reference.name, potential_hash(reference.law)]
    elif reference.path is not None:
        identity = ["file", str(reference.path), reference.name]
    else:
        identity = ["stock", reference.name]
    manifest = kept_manifest("potentials", identity, target, {}, lambda: potential_manifest(reference, target))
    key, _, functions = loaded(target, manifest)
    return PotentialKernel(
        potential=manifest["name"],
        target=target,
        key=key,
        fingerprint=manifest["fingerprint"],
        parameters=tuple(manifest["parameters"]),
        positive=tuple(manifest["positive"]),
        not_negative=tuple(manifest["not_negative"]),
        ranges=manifest["ranges"],
        pairs=functions.pairs,
        activities=getattr(functions, "activities", None),
    )


def energies_and_forces(kernel: PotentialKernel, p: Array, r: Array, contact: Array) -> tuple[Array, Array, Array]:
    """Energy, force that pushes apart, and its slope, of pairs at the distances r; nan beyond the domain.

    Parameters
    ----------
    p : array
        Parameters, in the kernel's order.
    r, contact : array, shape (n,)
        Distances of the centres, and those at which the surfaces touch.
    """
    out = np.empty((3, len(r)))
    kernel.pairs(len(r), np.ascontiguousarray(r), np.ascontiguousarray(contact), p, out[0], out[1], out[2])
    return out[0], out[1], out[2]


def activities(kernel: PotentialKernel, p: Array, shear_rate: float | Array, age: Array) -> tuple[Array, Array]:
    """Factor of the energy of pairs of these ages, and its slope in the age; 1 and 0 without an activation.

    Parameters
    ----------
    kernel : PotentialKernel
    p : array, shape (parameters,)
    shear_rate : float, or array, shape (n,)
        Of the background flow, or where each pair is, 1/time.
    age : array, shape (n,)
        Times that pairs have been within the cut-off.
    """
    if kernel.activities is None:
        return np.ones(len(age)), np.zeros(len(age))
    out = np.empty((2, len(age)))
    rates = np.abs(np.full(len(age), shear_rate))
    kernel.activities(len(age), rates, np.ascontiguousarray(age), p, out[0], out[1])
    return out[0], out[1]
