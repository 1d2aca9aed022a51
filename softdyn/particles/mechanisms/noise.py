"""Noise: what molecules do to particles that drag resists, by the theorem of fluctuation and dissipation.

Each coordinate moves by the force over the drag Z, and by white noise of the strength 2 kT/Z. These scenes have a
method of their own, :mod:`softdyn.particles.brownian`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from softdyn.particles.mechanisms import Mechanism
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import POSITIVE, choice, whole_number

if TYPE_CHECKING:
    from softdyn.particles.system import ValidatedScene

#: Schemes, by their weak order.
SCHEMES = {"euler": 1, "heun": 2}


@with_keys
@dataclass(frozen=True)
class Noise:
    """Brownian motion of the particles."""

    temperature: Annotated[
        float, Key("[noise] temperature", POSITIVE, "Temperature as an energy, k_B T.", "force length")
    ]
    seed: Annotated[
        int | None,
        Key("[noise] seed", whole_number(0), "Seed of the noise: the same seed gives the same run. It has no default."),
    ] = None
    scheme: Annotated[
        str,
        Key(
            "[noise] scheme",
            choice("scheme", tuple(SCHEMES)),
            'How a step is taken: "heun", of weak order 2, or "euler" (Euler and Maruyama), of weak order 1.',
        ),
    ] = "heun"
    step: Annotated[
        float | None,
        Key(
            "[noise] step",
            POSITIVE,
            "Length of the steps, at most; without it a tenth of the shortest time in which forces relax that 8 kT "
            "reach. Steps end at output times.",
            "time",
        ),
    ] = None


@dataclass(frozen=True)
class Bath(Mechanism):
    """A fluid at a temperature: what it gives, by noise and flow, less what its drag takes."""

    noise: Noise

    gives = ("bath",)


def check(facts: ValidatedScene, faults: list[str]) -> Bath | None:
    """Noise of a scene."""
    given, scene = facts.scene.noise, facts.scene
    assert given is not None
    if given.seed is None:
        faults.append("[noise] seed is missing: a whole number, by which the run can be made again")
    if not scene.drag:
        faults.append("[noise] is that of the fluid whose drag resists the particles: give [flow] drag, 1 for Stokes'")
    return Bath(given)
