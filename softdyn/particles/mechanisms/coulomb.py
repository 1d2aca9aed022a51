"""Coulomb friction: |T| <= mu N where surfaces touch, and what resists rolling and twisting, |M| <= rolling R N."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Annotated

from softdyn.particles.mechanisms import Mechanism
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import NOT_NEGATIVE, between

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from softdyn.particles.contact_kernels import ContactKernel
    from softdyn.particles.system import ValidatedScene


@with_keys
@dataclass(frozen=True)
class Friction:
    """Coulomb friction of surfaces that touch."""

    mu: Annotated[
        float,
        Key("[friction] mu", NOT_NEGATIVE, "Coefficient of friction: largest force along the surfaces over N."),
    ] = 0.0
    rolling: Annotated[
        float,
        Key(
            "[friction] rolling",
            NOT_NEGATIVE,
            "Largest moment that resists rolling, over N and the radius R = 2 R1 R2/(R1 + R2) of the pair.",
        ),
    ] = 0.0
    twisting: Annotated[
        float,
        Key(
            "[friction] twisting",
            NOT_NEGATIVE,
            "Largest moment that resists twisting about the normal, in three dimensions, over N and the same radius.",
        ),
    ] = 0.0
    restitution: Annotated[
        float,
        Key(
            "[friction] restitution",
            between(0.0, 1.0),
            "Speed of rigid grains behind a collision over that before it; soft ones have it from the dashpot of their "
            "law.",
        ),
    ] = 0.0


@dataclass(frozen=True)
class Rubbing(Mechanism):
    """Coefficients of friction, of rolling and twisting, both over R; and the restitution of rigid grains."""

    mu: float
    rolling: float
    twisting: float
    restitution: float

    takes = ("friction",)

    def ready(self, facts: ValidatedScene, kernel: ContactKernel, p: NDArray[np.float64]) -> Mechanism:
        """What implicit steps have of it; the other methods have it in their own kernels."""
        made: Mechanism = import_module("softdyn.particles.mechanisms.rubbing").implicit(self, facts)
        return made


def check(facts: ValidatedScene, faults: list[str]) -> Rubbing | None:
    """Friction of a scene."""
    given, d = facts.scene.friction, facts.x.shape[1]
    assert given is not None
    if d == 1:
        faults.append("[friction] in one dimension surfaces do not slide along one another: leave it out")
        return None
    if given.twisting and d == 2:
        faults.append("[friction] twisting: discs and spheres in two dimensions do not twist: leave it out")
    if given.restitution and facts.scene.law is not None:
        faults.append(
            "[friction] restitution is that of rigid grains, without a law; soft ones have it from the dashpot of "
            "their law: leave it out"
        )
    return Rubbing(float(given.mu), float(given.rolling), float(given.twisting), float(given.restitution))
