"""Scenes of dry grains: a part of each, and laws that are known of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softdyn.particles import ParticleScene, pressure, read_scene, simulate
from softdyn.scene.stock_scenes import particle_scenes


def scene(name: str) -> ParticleScene:
    return read_scene(particle_scenes()[name])


@pytest.mark.parametrize("name", ["collapse", "hopper", "drum", "shear_dry"])
def test_scenes_of_grains_run_with_their_energy_in_balance(name: str) -> None:
    """Their beginning, by explicit steps; what is given goes into motion, friction and dashpots."""
    given = scene(name)
    changes = {"until_strain": 0.2} if given.until_strain else {"until_t": 1.5}
    result = simulate(replace(given, times=3, **changes))
    assert result.stats["method"].startswith("explicit")
    assert abs(result.energy["imbalance"]) < 0.01
    assert result.energy["kinetic"] > 0 or result.energy["friction"] > 0


@pytest.mark.slow
def test_the_friction_of_plane_shear_is_that_of_da_cruz() -> None:
    """Phys. Rev. E 72 (2005) 021309: mu = 0.25 + 1.1 I, within a tenth, its scatter."""
    result = simulate(scene("shear_dry"))
    half = len(result) // 3
    P = float(pressure(result)[half:].mean())
    mu = float(result.stress[half:, 0, 1].mean()) / P
    inertial = 0.1 * np.sqrt(1.0 / P)
    assert 0.05 < inertial < 0.2
    assert mu == pytest.approx(0.25 + 1.1 * inertial, rel=0.1)
