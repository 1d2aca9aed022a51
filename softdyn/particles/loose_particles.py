"""Particles without a contact law: what stands for the kernel of their contacts, which have no force.

They pass through one another, unless potentials keep them apart; the fluid resists them as it does spheres.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.contact_kernels import ContactKernel

if TYPE_CHECKING:
    from softdyn.particles.particle_keys import ParticleScene

Array = NDArray[np.float64]

#: What a result calls the law of such particles.
NAME = "no contacts"


def is_loose(scene: ParticleScene) -> bool:
    """Whether a scene is of particles whose forces are potentials, bonds or noise alone."""
    return scene.law is None and scene.inertia is None and bool(scene.potential or scene.bond or scene.noise)


@cache
def _drag() -> Any:
    from sympy import lambdify

    from softdyn.derive.sphere import drag_of_sphere
    from softdyn.derive.symbols import R, eta

    return lambdify([eta, R], drag_of_sphere(R))


def no_contact_kernel(target: str, drag: bool) -> ContactKernel:
    """What the engine asks of a kernel of contacts, of contacts that do nothing."""
    from softdyn.derive.contact_kernel import OUTPUTS

    def nothing(*given: Any) -> Any:
        given[-1][:] = 0.0

    def of_spheres(n: int, p: Array, q: Array, out: Array) -> None:
        out[:] = _drag()(p[0], q)

    return ContactKernel(
        law=NAME,
        target=target,
        key=NAME,
        contact="none",
        fingerprint=NAME,
        uniform=("eta",) if drag else (),
        varying=("R",),
        outputs=tuple(symbol.name for symbol in OUTPUTS),
        fading=False,
        tangential=(),
        compile_s=0.0,
        contacts=nothing,
        state=nothing,
        energy=nothing,
        drag=of_spheres if drag else None,
        rub=None,
        bounded=True,
        pressed_only=False,
        tabulated=False,
        positive=("eta",),
        ranges={},
    )
