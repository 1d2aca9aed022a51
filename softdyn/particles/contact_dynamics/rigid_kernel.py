"""The kernel of the contacts of rigid grains: made, compiled and loaded."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softdyn.kernels import choose_target, kept_manifest, loaded


@dataclass(frozen=True)
class RigidKernel:
    """A loaded kernel of rigid contacts; see the template ``rigid``.

    Attributes
    ----------
    law : str
        What stands in a result for the law's name.
    target, key, fingerprint : str
    dimension, width : int
        Of space; velocities of a grain, with those of rotation.
    operations : dict of int
        Of a contact in one sweep, and in Newton's matrix.
    compile_s : float
        Time spent on deriving, building and loading it.
    mobilities, slips, kicks, sweeps, residual, linearise, follow : functions
    """

    law: str
    target: str
    key: str
    fingerprint: str
    dimension: int
    width: int
    operations: dict[str, int]
    compile_s: float
    mobilities: Callable[..., None]
    slips: Callable[..., None]
    kicks: Callable[..., None]
    sweeps: Callable[..., int]
    residual: Callable[..., int]
    linearise: Callable[..., float]
    follow: Callable[..., None]


def rigid_manifest(dimension: int, target: str) -> dict[str, Any]:
    """Derive the kernel in some dimension; imports the derivation stage."""
    from softdyn.derive.emit import write
    from softdyn.derive.kernel_form import operations_of
    from softdyn.derive.rigid_contact_kernel import rigid_ir

    ir = rigid_ir(dimension)
    written = write(ir, target)
    counted = {name: sum(counts.values()) for name, counts in operations_of(ir).items()}
    return {
        "name": ir.name,
        "fingerprint": ir.provenance.fingerprint,
        "width": dimension + ir.settings["turns"],
        "sweep": counted["slip"] + counted["project"] + counted["kick"],
        "linearise": counted["slip"] + max(counted["stick"], counted["slide"]) + counted["blocks"],
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "later": ["linearise", "follow"],
        "depends": {},
    }


def get_rigid_kernel(dimension: int, target: str = "auto") -> RigidKernel:
    """Kernel of rigid contacts in 1, 2 or 3 dimensions, from the cache or made now.

    Raises
    ------
    SceneError, CompileError
    """
    began = time.perf_counter()
    target = choose_target(target)
    manifest = kept_manifest(
        "rigid", dimension, target, {"dimension": dimension}, lambda: rigid_manifest(dimension, target)
    )
    key, _, functions = loaded(target, manifest)
    return RigidKernel(
        law="rigid grains",
        target=target,
        key=key,
        fingerprint=manifest["fingerprint"],
        dimension=dimension,
        width=int(manifest["width"]),
        operations={name: int(manifest[name]) for name in ("sweep", "linearise")},
        compile_s=time.perf_counter() - began,
        **{
            name: getattr(functions, name)
            for name in ("mobilities", "slips", "kicks", "sweeps", "residual", "linearise", "follow")
        },
    )
