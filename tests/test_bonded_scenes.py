"""The stock scenes of chains and of platelets in a fluid, held against what is known of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import softdyn
from softdyn.particles import PairPotential
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate

pytestmark = pytest.mark.slow

#: What balances close to.
CLOSED = 1e-10
#: Length of the channel, and distance at which two platelets are next to one another; the well ends at 0.9.
LENGTH, NEXT = 16.0, 0.62


def run(scene: SuspensionScene) -> SuspensionResult:
    result = simulate(scene)
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < CLOSED for kind in kinds)
    assert not result.warnings
    return result


def stock(name: str) -> SuspensionScene:
    scene = softdyn.read_scene(suspension_scenes()[name])
    assert isinstance(scene, SuspensionScene)
    return scene


def test_chains_in_a_channel_are_stretched_along_the_flow() -> None:
    """Coiled chains unfold; the mean angle of their longest axis with the flow falls below 20 degrees, 45 at random."""
    result = run(stock("chains_flow"))
    beads = result.x.reshape(len(result), 12, 8, 2)
    away = beads - beads.mean(axis=2, keepdims=True)
    size = np.sqrt((away**2).sum(axis=3).mean(axis=2)).mean(axis=1)
    assert size[-1] > 1.3 * size[0]
    shapes = np.einsum("tcbi,tcbj->tcij", away, away)
    longest = np.linalg.eigh(shapes)[1][:, :, :, 1]
    angles = np.degrees(np.arctan2(np.abs(longest[:, :, 1]), np.abs(longest[:, :, 0]))).mean(axis=1)
    assert angles[-1] < 20 < angles[0]
    assert result.bond_r.max() < 0.42 + 0.15
    assert np.isinf(result.bond_broken).all()
    # the walls hold them all
    assert (result.x[:, :, 1] > 0.1).all()
    assert (result.x[:, :, 1] < 7.9).all()


def stuck(result: SuspensionResult) -> np.ndarray:
    """Pairs that are next to one another in each of the last four frames, 1.5 units of time, as (i, j)."""
    together = np.ones((len(result.radii),) * 2, dtype=bool)
    for frame in range(-4, 0):
        apart = result.x[frame][:, None] - result.x[frame][None]
        apart[..., 0] -= LENGTH * np.round(apart[..., 0] / LENGTH)
        together &= np.linalg.norm(apart, axis=2) < NEXT
    return np.argwhere(np.triu(together, 1))


def largest_cluster(pairs: np.ndarray, count: int) -> int:
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return int(np.bincount(connected_components(links, directed=False)[1]).max())


def test_platelets_stick_where_the_shear_rate_is_high() -> None:
    """With the activation clusters grow, next to the walls; without, pairs meet and part."""
    scene = stock("thrombus")
    well = scene.potential[0]
    off = PairPotential(well.potential, {**well.parameters, "threshold": 1e6}, cut_off=well.cut_off)
    with_it, without = run(scene), run(replace(scene, potential=[off]))
    pairs, few = stuck(with_it), stuck(without)
    assert len(pairs) > 4 * len(few)
    assert largest_cluster(pairs, 120) >= 8 > largest_cluster(few, 120)
    heights = np.abs(with_it.x[-1, pairs, 1].mean(axis=1) - 4)
    assert np.mean(heights > 1.3) > 0.7  # two thirds of the channel
