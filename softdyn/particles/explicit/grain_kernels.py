"""The kernel of grains of a law: made, compiled and loaded."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import choose_target, loaded, manifest_of
from softdyn.laws import LawReference, find
from softdyn.scene.numbers import Range

Array = NDArray[np.float64]
Short = NDArray[np.int32]


@dataclass(frozen=True)
class GrainKernel:
    """A loaded kernel of grains.

    Attributes
    ----------
    law, target, key, fingerprint : str
    uniform, varying : tuple of str
        What the arrays ``p`` and ``q`` hold.
    outputs : tuple of str
        What :func:`contact` gives.
    damped, rolling, twisting, sheared : bool
    d, rotations : int
    compile_s : float
        Time spent on deriving, building and loading it.
    contact, neighbours, incoming, carry, run : functions
        See the template ``grains``.
    positive : tuple of str
        Parameters that must be positive.
    ranges : mapping from str to (low, high, whether low is left out, whether high is)
    """

    law: str
    target: str
    key: str
    fingerprint: str
    uniform: tuple[str, ...]
    varying: tuple[str, ...]
    outputs: tuple[str, ...]
    damped: bool
    rolling: bool
    twisting: bool
    sheared: bool
    d: int
    rotations: int
    compile_s: float
    contact: Callable[..., None]
    neighbours: Callable[..., int]
    incoming: Callable[..., None]
    carry: Callable[..., None]
    run: Callable[..., int]
    positive: tuple[str, ...]
    ranges: Mapping[str, Range]

    @property
    def kept(self) -> int:
        """Numbers of a contact's history: the tangential force, those of rolling and of twisting."""
        force = {0: 0, 1: 1, 3: 3}[self.rotations]
        return force + (self.rotations if self.rolling else 0) + (1 if self.twisting else 0)

    @property
    def seen(self) -> int:
        """Numbers that contacts see of a particle."""
        return 1 + 2 * self.d + self.rotations + (self.d if self.damped else 0) + (1 if self.sheared else 0)


def grain_manifest(reference: LawReference, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    """Derive a kernel of grains; imports the derivation stage.

    Parameters
    ----------
    reference : LawReference
    target : str
    needs : mapping
        Fields of :class:`softdyn.derive.grain_kernel.GrainNeeds`.
    """
    from softdyn.derive.emit import write
    from softdyn.derive.grain_kernel import GrainNeeds, grain_ir
    from softdyn.derive.law import parameters_of, plain_ranges
    from softdyn.laws import load

    law, depends = load(reference)
    ir = grain_ir(law, GrainNeeds(**{**needs, "varying": tuple(needs["varying"])}))
    written = write(ir, target)
    return {
        "name": ir.name,
        "fingerprint": ir.provenance.fingerprint,
        "uniform": ir.arrays["p"],
        "varying": ir.arrays["q"],
        "outputs": ir.functions["force"].gives,
        "settings": dict(ir.settings),
        "positive": [symbol.name for symbol in parameters_of(law, True) if symbol.is_positive],
        "ranges": plain_ranges(law),
        "source": written.text,
        "suffix": written.suffix,
        "functions": written.functions,
        "depends": depends,
    }


def get_grain_kernel(law: Any, target: str, needs: Mapping[str, Any]) -> GrainKernel:
    """Kernel of grains of a law, from the cache or made now.

    Parameters
    ----------
    law : str, Path or ContactLaw
    target : "auto", "c" or "numba"
    needs : mapping
        The fields of :class:`softdyn.derive.grain_kernel.GrainNeeds`.

    Raises
    ------
    LawError, SceneError, CompileError
    """
    began = time.perf_counter()
    target = choose_target(target)
    manifest = manifest_of(find(law), target, dict(needs), "grains", grain_manifest)
    key, _, functions = loaded(target, manifest)
    settings = manifest["settings"]
    return GrainKernel(
        law=manifest["name"],
        target=target,
        key=key,
        fingerprint=manifest["fingerprint"],
        uniform=tuple(manifest["uniform"]),
        varying=tuple(manifest["varying"]),
        outputs=tuple(manifest["outputs"]),
        damped=bool(settings["damped"]),
        rolling=bool(settings["rolling"]),
        twisting=bool(settings["twisting"]),
        sheared=bool(settings["sheared"]),
        d=int(settings["d"]),
        rotations=int(settings["rotations"]),
        compile_s=time.perf_counter() - began,
        contact=functions.contact,
        neighbours=functions.neighbours,
        incoming=functions.incoming,
        carry=functions.carry,
        run=functions.run,
        positive=tuple(manifest["positive"]),
        ranges=manifest["ranges"],
    )
