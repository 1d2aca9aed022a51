"""Chains and rings of particles, placed at random where none overlap another.

A chain grows bead by bead, each in a random direction; one that finds no room takes a step back, and in the end starts
elsewhere. A ring is a regular polygon, placed and turned at random.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.mechanisms.bonds import CHAINS, Bond
from softdyn.scene.keys import Key, key_faults, with_keys
from softdyn.scene.kinds import FLAG, LENGTHS, POSITIVE, whole_number
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.particles.particle_keys import ParticleScene

Array = NDArray[np.float64]

#: Directions that a bead tries before its chain takes a step back, and places that a chain or a ring tries.
TRIALS, PLACES = 60, 200
#: Beads of one chain or ring that are neighbours but for one are at least this many spacings apart.
FOLDED = 0.9


@with_keys
@dataclass(frozen=True)
class Chains:
    """Where particles start: chains, or rings, of beads at random places in a periodic box, or between walls."""

    count: Annotated[int, Key("[chains] count", whole_number(1), "How many chains.")]
    beads: Annotated[int, Key("[chains] beads", whole_number(2), "Particles of each.")]
    radius: Annotated[float, Key("[chains] radius", POSITIVE, "Radius of the particles.", "length")]
    spacing: Annotated[float, Key("[chains] spacing", POSITIVE, "Distance of the centres of two neighbours.", "length")]
    seed: Annotated[
        int, Key("[chains] seed", whole_number(0), "Seed of the places: the same seed gives the same chains.")
    ]
    box: Annotated[
        Sequence[float] | None,
        Key(
            "[chains] box", LENGTHS, "Edges of the periodic box, two or three; in a fluid those of the mesh.", "length"
        ),
    ] = None
    ring: Annotated[bool, Key("[chains] ring", FLAG, "Whether the last of each is bonded to the first.")] = False


def placed_chains(chains: Chains, walled: Sequence[int] = ()) -> tuple[Array, NDArray[np.int64]]:
    """Positions of all beads, chain by chain, shape (count beads, d), and the pairs of neighbours, shape (bonds, 2).

    Between walls, across the axes ``walled``, beads are a radius away from these at least.

    Raises
    ------
    SceneError
        If there is no room.
    """
    box = np.array(chains.box, dtype=float)
    d, n = len(box), chains.beads
    apart = min(2 * chains.radius, FOLDED * chains.spacing)
    rng = np.random.default_rng(chains.seed)
    whole = np.empty((0, d))
    for number in range(chains.count):
        found = (_ring if chains.ring else _chain)(chains, box, whole, apart, rng, list(walled))
        if found is None:
            raise SceneError(
                f"[chains] there is no room for {chains.count} of {n} beads: {number} were placed; use fewer, a larger "
                "box or another seed"
            )
        whole = np.concatenate([whole, found])
    return whole, chain_pairs(chains.count, n, chains.ring)


def chain_pairs(count: int, beads: int, ring: bool) -> NDArray[np.int64]:
    """Numbers of neighbours in chains that stand one after the other, shape (bonds, 2).

    Parameters
    ----------
    count : int
        Chains.
    beads : int
        Of each.
    ring : bool
        Whether the ends of a chain of three or more are neighbours, too.
    """
    first = np.arange(beads - 1)
    ends = np.column_stack([first, first + 1])
    if ring and beads > 2:
        ends = np.concatenate([ends, [[0, beads - 1]]])
    return np.concatenate([ends + beads * chain for chain in range(count)])


def _are_free(places: Array, others: Array, box: Array, apart: float) -> NDArray[np.bool_]:
    """Which of some places are as far from all others as they must be."""
    if not len(others):
        return np.ones(len(places), dtype=bool)
    away = others[None] - places[:, None]
    away -= box * np.round(away / box)
    return np.asarray(np.einsum("ijk,ijk->ij", away, away).min(axis=1) >= apart**2)


def _are_between(places: Array, chains: Chains, box: Array, walled: list[int]) -> NDArray[np.bool_]:
    """Which of some places are away from all walls."""
    inside = (places >= chains.radius) & (places <= box - chains.radius)
    return np.asarray(inside[:, walled].all(axis=1))


def _directions(count: int, d: int, rng: np.random.Generator) -> Array:
    vectors = rng.standard_normal((count, d))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def _chain(
    chains: Chains, box: Array, whole: Array, apart: float, rng: np.random.Generator, walled: list[int]
) -> Array | None:
    d = len(box)
    for _ in range(PLACES):
        beads = [rng.uniform(0, box)]
        first = beads[0][None]
        if not (_are_free(first, whole, box, apart) & _are_between(first, chains, box, walled))[0]:
            continue
        backwards = 0
        while len(beads) < chains.beads and backwards < 10 * chains.beads:
            others = np.concatenate([whole, np.array(beads[:-1]).reshape(-1, d)])
            trials = beads[-1] + chains.spacing * _directions(TRIALS, d, rng)
            good = _are_free(trials, others, box, apart) & _are_between(trials, chains, box, walled)
            free = np.flatnonzero(good)
            if len(free):
                beads.append(trials[free[0]])
                continue
            backwards += 1
            del beads[max(1, len(beads) - 3) :]
        if len(beads) == chains.beads:
            return np.array(beads)
    return None


def _ring(
    chains: Chains, box: Array, whole: Array, apart: float, rng: np.random.Generator, walled: list[int]
) -> Array | None:
    d, n = len(box), chains.beads
    angles = 2 * math.pi * np.arange(n) / n
    size = chains.spacing / (2 * math.sin(math.pi / n))
    for _ in range(PLACES):
        plane = np.linalg.qr(rng.standard_normal((d, d)))[0][:2]
        centre = rng.uniform(0, box)
        beads = centre + size * (np.cos(angles)[:, None] * plane[0] + np.sin(angles)[:, None] * plane[1])
        if (_are_free(beads, whole, box, apart) & _are_between(beads, chains, box, walled)).all():
            return np.asarray(beads)
    return None


def with_chains(scene: ParticleScene, chains: Any) -> dict[str, Any]:
    """Fields of a scene that follow from its chains: positions, radii, box, and pairs of its bonds.

    Raises
    ------
    SceneError
    """
    require_chains(chains)
    faults = key_faults(chains)
    box = list(chains.box) if isinstance(chains.box, (list, tuple, np.ndarray)) else []
    if len(box) not in (2, 3) or not all(edge is not None and edge > 0 for edge in box):
        faults.append(f"[chains] box needs two or three lengths, positive, not {chains.box!r}")
    if scene.positions is not None or scene.radii is not None:
        faults.append("[particles] and [chains] are two ways to say where the particles are: give one of them")
    if scene.box is not None or scene.tilt:
        faults.append("[box] follows from [chains]: leave it out, but for its depth")
    faults += _faults(chains, scene.bond, bool(faults))
    if faults:
        raise SceneError(listed(faults))
    x, pairs = placed_chains(chains)
    bonds = bonds_of_chains(scene.bond, pairs)
    return {"positions": x, "radii": np.full(len(x), float(chains.radius)), "box": box, "bond": bonds}


def require_chains(chains: Any) -> None:
    """Refuse what is no chains.

    Raises
    ------
    SceneError
    """
    if not isinstance(chains, Chains):
        raise SceneError(f"chains must be Chains(...), not {chains!r}")


def _faults(chains: Chains, bonds: Sequence[Bond], more: bool) -> list[str]:
    """What is wrong with chains and their bonds; ``more`` where something else is, too."""
    faults = []
    if not any(isinstance(bond, Bond) and bond.pairs == CHAINS for bond in bonds):
        faults.append(f'[chains] has no bonds: give [[bond]] pairs = "{CHAINS}"')
    if not (faults or more) and chains.ring and chains.beads < 3:
        faults.append(f"[chains] a ring needs three beads, not {chains.beads}")
    if not (faults or more) and 2 * chains.radius > chains.spacing * 2:
        faults.append(f"[chains] spacing = {chains.spacing:g} lets neighbours overlap by more than a radius")
    return faults


def bonds_of_chains(bonds: Sequence[Bond], pairs: NDArray[np.int64]) -> tuple[Bond, ...]:
    """Bonds of a scene, those of its chains between the pairs of neighbours in these, shape (pairs, 2)."""
    return tuple(replace(one, pairs=pairs.tolist()) if one.pairs == CHAINS else one for one in bonds)


def chains_between(
    chains: Any, bonds: Sequence[Bond], low: Array, high: Array, walled: Sequence[int]
) -> tuple[Array, tuple[Bond, ...]]:
    """Positions of the beads of chains in a box, shape (beads, d), and the bonds of the scene.

    Parameters
    ----------
    chains : Chains
    bonds : sequence of Bond
    low, high : array, shape (d,)
        Corners of the box.
    walled : sequence of int
        Axes along which it has walls; it is periodic along the others.

    Raises
    ------
    SceneError
    """
    require_chains(chains)
    faults = key_faults(chains)
    if chains.box is not None:
        faults.append("[chains] box follows from the mesh: leave it out")
    faults += _faults(chains, bonds, bool(faults))
    if faults:
        raise SceneError(listed(faults))
    x, pairs = placed_chains(replace(chains, box=(high - low).tolist()), walled)
    return x + low, bonds_of_chains(bonds, pairs)
