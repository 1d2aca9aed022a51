"""The stock scenes of grains in a fluid, held against what is known of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import softdyn
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles.packing import random_packing
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.suspension_run import made_ready

pytestmark = pytest.mark.slow

#: What balances close to, over what flows: of grains that have come to rest that is next to nothing.
CLOSED = 1e-10


def run(name: str) -> SuspensionResult:
    scene = softdyn.read_scene(suspension_scenes()[name])
    assert isinstance(scene, SuspensionScene)
    result = simulate(scene)
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < CLOSED for kind in kinds)
    assert not result.warnings
    return result


def excess(result: SuspensionResult, area: float) -> np.ndarray:
    """Pressure below less that above, and less the weight of the fluid alone, times the area: of each frame."""
    y = result.p_at[:, 1]
    low, high = np.abs(y) < 1e-9, np.abs(y - y.max()) < 1e-9
    drop = result.p[:, low].mean(axis=1) - result.p[:, high].mean(axis=1)
    return np.asarray((drop - y.max()) * area)


def test_a_depot_rests_on_walls_and_the_fluid_carries_none_of_it() -> None:
    """While grains sink, the pressure carries their weight less buoyancy; at the end the walls do.

    A bed of this stiffness rings for some time, and its last motions are told: speeds below 1e-2 of those of the fall
    leave forces of a hundredth.
    """
    result = run("depot")
    buoyant = 0.6 * -result.grain_weight[-1, 1]
    sinking = (result.t > 4) & (result.t < 10)
    carried = -sum(result.arrays[f"contact_force_{name}"][:, 1] for name in ("left", "right", "bottom")) / buoyant
    pressure = excess(result, 8.0) / buoyant
    # walls of the fluid rub, too, and what sinks in the middle rises at the sides
    assert (pressure + carried)[sinking] == pytest.approx(1.0, abs=0.15)
    assert pressure[sinking].min() > 0.6
    assert carried[-1] == pytest.approx(1.0, abs=0.01)
    assert pressure[-1] == pytest.approx(0.0, abs=0.01)
    assert np.abs(result.v[-1]).max() < 0.01 * np.abs(result.v).max()
    assert (result.x[-1, :, 1] > 0.9 * result.radii).all()


def test_a_bed_is_fluidised_when_the_pressure_carries_it() -> None:
    """At rest, on the way up through the minimum, above it, and on the way down: the bed comes back looser, later."""
    result = run("fluidised")
    weight = 0.6 * -result.grain_weight[-1, 1]
    drop = excess(result, 16.0) / weight
    floor = -result.contact_force_bottom[:, 1] / weight
    rest, above = (result.t > 13) & (result.t < 19), (result.t > 44) & (result.t < 55)
    assert drop[rest] == pytest.approx(0.0, abs=0.02)
    assert floor[rest] == pytest.approx(1.0, abs=0.02)
    assert drop[above] == pytest.approx(1.0, abs=0.02)
    assert floor[above] == pytest.approx(0.0, abs=0.02)
    below = (result.t > 21) & (result.t < 40)
    assert (np.diff(drop[below]) > 0).all()
    height = 2 * result.x[:, :, 1].mean(axis=1)
    up, down = np.searchsorted(result.t, (40.0, 80.0))
    assert height[down] > 1.1 * height[up]


def test_a_bed_of_real_grains_has_the_pressure_drop_of_its_closure() -> None:
    """Stokes flow through 100 spheres that are held in a periodic box, at phi = 0.6: the flux within 2 %.

    What grains make of the porosity about them varies, and the drag is more than linear in it.
    """
    x, _, lengths = random_packing(count=100, dimension=3, fraction=0.6, seed=1, radii=[0.5])
    side, phi = float(lengths[0]), 0.6
    pairs = (["left", "right"], ["bottom", "top"], ["front", "back"])
    scene = SuspensionScene(
        viscosity=1.0, elements="P1-P1", mesh=MeshSection(box=[side] * 3, cells=[5] * 3), force=[1.0, 0.0, 0.0],
        boundary=[Boundary(pair, periodic=True) for pair in pairs], until_t=1.0, dt=1.0, times=2, positions=x,
        radii=0.5, held=True, drag="ergun", width=1.5,
    )  # fmt: skip
    result = simulate(scene)
    flux = float((made_ready(scene).maps.moments @ result.u[-1]).sum(axis=0)[0]) / side**3
    assert 100 * math.pi / 6 / side**3 == pytest.approx(phi, rel=1e-12)
    assert flux == pytest.approx((1 - phi) ** 3 / (150 * phi**2), rel=0.02)
